//! Reads a file: header, surfaces, and the records after them.

use super::header::Header;
use super::read_surface::{RawSurface, Shapes};
use super::record::{Line, SOLVES, SURFACE_BOOKKEEPING, SURFACE_LOST};
use crate::draft::{Aperture, Draft, Import, Item, MOST_SURFACES, Record, check_size};
use crate::loss::{Effect, Losses};
use petzval_base::FileError;
use petzval_optics::glass::Catalog;

/// Records of a surface. In a file without indentation they belong to the last surface.
const SURFACE_RECORDS: &[&str] = &[
    "TYPE", "CURV", "CONI", "PARM", "XDAT", "DISZ", "GLAS", "DIAM", "STOP", "COMM", "CLAP", "FLAP", "SQAP",
    "ELAP", "OBSC", "SQOB", "ELOB", "OBDC", "SCBD", "UDAD", "SPID", "IGNR",
];

/// Records that begin the part after the surfaces.
const REST: &[&str] = &["TOL", "MNUM", "MOFF", "BLNK", "DMFS"];

/// Reads a lens file. Glasses are looked up in `catalog` by their exact name.
///
/// Errors name the first record that cannot be traced as it stands, with its line.
pub fn parse_zmx(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    parse_zmx_start(text, catalog)?.buildable()
}

/// Reads a lens file to start an optimisation from: [`Import::unbuildable`] says whether its glass is too thin or its surfaces cross.
pub fn parse_zmx_start(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    check_size(text)?;
    let (mut header, mut losses) = (Header::default(), Losses::default());
    let mut surfaces: Vec<RawSurface<'_>> = Vec::new();
    let mut behind = false;
    let last_surface = Line::all(text).filter(|line| line.keyword == "SURF").last();
    let last_surface = last_surface.map_or(0, |line| line.number);
    for line in Line::all(text) {
        check_capitals(&line)?;
        if line.keyword == "SURF" {
            if behind {
                let message = "a surface after merit function, tolerances or configurations is not read";
                return Err(line.error(message).hint("surfaces come first"));
            }
            if line.count(0)? != surfaces.len() {
                return Err(line.error(format!("this is not the next surface, which is {}", surfaces.len())));
            }
            if surfaces.len() > MOST_SURFACES {
                return Err(line.error(format!("a lens with more than {MOST_SURFACES} surfaces is not read")));
            }
            surfaces.push(RawSurface::new(line));
            continue;
        }
        match surfaces.last_mut() {
            None => header.read(&line, &mut losses)?,
            Some(surface) if !behind && (line.indented || is_of_surface(line.keyword)) => {
                surface.read(line, &mut losses)?;
            }
            Some(_) if behind || REST.contains(&line.keyword) || line.number > last_surface => {
                behind = true;
                read_behind(&line, &mut losses);
            }
            // An unknown record among the surfaces does not end them.
            Some(_) => {
                line.lose(&mut losses, Effect::NotUnderstood, "this record is not understood");
            }
        }
    }
    finish(header, surfaces, catalog, losses)
}

/// Refuses known keywords in lower case: the surfaces of the file would be lost.
fn check_capitals(line: &Line<'_>) -> Result<(), FileError> {
    let upper = line.keyword.to_ascii_uppercase();
    if upper != line.keyword && (upper == "SURF" || is_of_surface(&upper)) {
        Err(line.error(format!("keywords are written in capitals: {upper}")))
    } else {
        Ok(())
    }
}

fn is_of_surface(keyword: &str) -> bool {
    SURFACE_RECORDS.contains(&keyword)
        || SURFACE_BOOKKEEPING.contains(&keyword)
        || SOLVES.contains(&keyword)
        || SURFACE_LOST.iter().any(|(lost, _)| *lost == keyword)
}

/// Reports the records of merit function, tolerances and configurations as losses.
fn read_behind(line: &Line<'_>, losses: &mut Losses) {
    let message = match line.keyword {
        "TOL" => "tolerances are not read",
        "MNUM" if line.number(0).ok().flatten().is_some_and(|n| n > 1.0) => {
            "only the configuration that the surfaces show is read"
        }
        // Settings of an empty list of configurations, and comments of the merit function.
        "MNUM" | "MOFF" | "BLNK" | "DMFS" => return,
        keyword
            if keyword.len() == 4
                && keyword.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit()) =>
        {
            "merit functions and further configurations are not read"
        }
        _ => {
            return line.lose(losses, Effect::NotUnderstood, "this record is not understood");
        }
    };
    losses.add_part(line.number, line.text, message);
}

fn finish(
    header: Header,
    surfaces: Vec<RawSurface<'_>>,
    catalog: &Catalog,
    mut losses: Losses,
) -> Result<Import, FileError> {
    let [object, between @ .., image] = &surfaces[..] else {
        let message = "this is not a lens: it has no object, surface and image";
        return Err(FileError::at_line(0, "", message).hint("each is a block `SURF number`"));
    };
    if header.mm == 0.0 {
        losses.assume("the file gives no unit; lengths are taken as mm");
    }
    let mm = if header.mm == 0.0 { 1.0 } else { header.mm };
    let shapes = Shapes { mm, catalog, catalogs: &header.catalogs };
    object.check_end(&shapes, "object")?;
    image.check_image(&shapes)?;
    if let Some(line) = object.stop.as_ref().or(image.stop.as_ref()) {
        return Err(line.error("neither object nor image can be the aperture stop"));
    }
    // Convert the surfaces between object and image, and find the stop.
    let mut items = Vec::with_capacity(between.len());
    let mut stop = None;
    for (index, raw) in between.iter().enumerate() {
        if let Some(line) = &raw.stop
            && stop.replace(index).is_some()
        {
            return Err(line.error("another surface is already the stop"));
        }
        items.push(match raw.coordinate_break(&shapes)? {
            Some(b) => Item::Break(b),
            None => Item::Surface(Box::new(raw.surface(&shapes, &mut losses)?)),
        });
    }
    let Some(stop) = stop else {
        let message = "no surface between object and image is the aperture stop";
        return Err(FileError::at_line(0, "", message).hint("a line `STOP` makes its surface the stop"));
    };
    // Collect wavelengths, fields and aperture.
    let wavelengths = header.wavelengths(&mut losses)?;
    let primary = match &header.primary {
        None => {
            losses.assume("the file gives no primary wavelength; the first is taken");
            0
        }
        Some((number, record)) => match number.checked_sub(1).filter(|i| *i < wavelengths.list.len()) {
            Some(index) => index,
            None => return Err(record.error(format!("there is no wavelength {number}"))),
        },
    };
    let fields = header.fields(mm, &mut losses);
    let Some(aperture) = header.aperture else {
        let message = "the file gives no aperture of a known kind";
        let hint = "ENPD, FNUM, OBNA and FLOA are read";
        return Err(FileError::at_line(0, "", message).hint(hint));
    };
    let aperture = match aperture {
        (Aperture::EntrancePupil(v), record) => (Aperture::EntrancePupil(v * mm), record),
        other => other,
    };
    let draft = Draft {
        name: header.name,
        source: header.notes.join("\n").trim_end().to_owned(),
        items,
        stop,
        aperture,
        object: (object.thickness_mm(&shapes)?, object.at()),
        wavelengths,
        reference: primary,
        fields,
        at_paraxial_focus: false,
    };
    draft.finish(losses)
}

impl RawSurface<'_> {
    fn at(&self) -> Record {
        self.thickness.as_ref().unwrap_or(&self.line).record()
    }
}
