//! Tolerances that reach beyond the room between the parts of a lens.

use std::path::Path;

use petzval_files::ToleranceFile;
use petzval_optics::lens::Lens;
use petzval_optics::tolerance::Tolerances;

use crate::context::Context;
use crate::event::WarningKind;

/// Warns of each such tolerance: of one of the file with its line, of one of a grade with its surfaces. Some of the lenses cannot be built.
pub(crate) fn warn_of_wide_tolerances(
    name: &str,
    lens: &Lens,
    (path, file): (Option<&Path>, &ToleranceFile),
    tolerances: &Tolerances,
    context: &Context,
) {
    let path = path.map_or_else(String::new, |path| path.display().to_string());
    for wide in &file.wide {
        let line = wide.line.map_or_else(String::new, |line| format!(":{line}"));
        let text = format!("{path}{line}: `{} = {}`: {} ({name})", wide.key, wide.value, wide.message);
        context.warning(WarningKind::LensFile, text);
    }
    for p in &tolerances.perturbations {
        let is_of_the_file = file.entries.iter().any(|entry| entry.freedom == p.freedom);
        let Some(room_mm) = p.freedom.room_mm(lens).filter(|room_mm| p.tolerance > *room_mm) else {
            continue;
        };
        if !is_of_the_file {
            let text = format!(
                "{name}: {}: the tolerance of {} mm of the grade is wider than the {room_mm:.4} mm that are there; some lenses cannot be built",
                p.freedom.name(),
                p.tolerance
            );
            context.warning(WarningKind::LensFile, text);
        }
    }
}
