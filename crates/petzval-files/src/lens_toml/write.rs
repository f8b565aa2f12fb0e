//! Writes a lens file; reading it gives the same bits.

use std::fmt::Write;

use super::parameter::{CURVATURE, parameter_name};
use super::{Expected, LensFile};
use crate::glass_toml::write_glass;
use crate::toml_number::{exact_degrees, exact_reciprocal, number, numbers, quoted, shortest};
use petzval_optics::glass::Glass;
use petzval_optics::lens::{
    Action, Axis, Departure, Lens, ObjectDistance, Pattern, Phase, Placement, Surface, xy_powers,
};
use petzval_optics::number::Number;

/// A lens file as text. It contains the formulas of its glasses, so that it is the same lens with any catalogue.
pub fn write_lens(file: &LensFile) -> String {
    let mut out = String::new();
    write(file, &mut out).expect("a string takes whatever is written to it");
    out
}

fn write(file: &LensFile, out: &mut String) -> std::fmt::Result {
    let lens = &file.lens;
    writeln!(out, "name = {}", quoted(&lens.name))?;
    if !lens.source.is_empty() {
        writeln!(out, "source = {}", quoted(&lens.source))?;
    }
    writeln!(out, "units = \"mm\"")?;

    writeln!(out, "\n[aperture]")?;
    writeln!(out, "entrance_pupil_diameter_mm = {}", number(lens.entrance_pupil_mm))?;
    let distance_mm = match lens.object {
        ObjectDistance::Infinity => f64::INFINITY,
        ObjectDistance::Finite(mm) => mm,
    };
    writeln!(out, "\n[object]\ndistance_mm = {}", number(distance_mm))?;
    writeln!(out, "\n[wavelengths]\num = {}", numbers(&lens.wavelengths_um))?;
    writeln!(out, "reference_um = {}", number(lens.reference_um))?;
    writeln!(out, "\n[fields]\nangle_deg = {}", numbers(&lens.fields_deg))?;
    if !file.field_weights.is_empty() {
        writeln!(out, "weight = {}", numbers(&file.field_weights))?;
    }

    let glasses = named_glasses(lens);
    for (name, glass) in &glasses {
        write_glass(name, glass, out)?;
    }
    for (i, surface) in lens.surfaces.iter().enumerate() {
        write_surface(surface, i == lens.stop, &glasses, out)?;
    }
    for v in &file.variables {
        writeln!(out, "\n[[variable]]\nsurface = {}", v.surface + 1)?;
        // Radii of both signs pass through the plane: the bounds of the curvature say so.
        let is_through_plane = v.number == Number::Curvature && v.min < 0.0 && v.max > 0.0;
        let (parameter, bounds) = if is_through_plane {
            let curvature = |radius_mm: f64| exact_reciprocal(radius_mm).unwrap_or(1.0 / radius_mm);
            (CURVATURE.to_owned(), [v.min, v.max].map(curvature))
        } else {
            (parameter_name(&lens.surfaces[v.surface], v.number), [v.min, v.max])
        };
        writeln!(out, "parameter = {}", quoted(&parameter))?;
        writeln!(out, "min = {}\nmax = {}", number(bounds[0]), number(bounds[1]))?;
    }
    for p in &file.pickups {
        let followed = &file.variables[p.variable];
        let parameter = parameter_name(&lens.surfaces[followed.surface], followed.number);
        writeln!(out, "\n[[pickup]]\nsurface = {}\nfollows = {}", p.surface + 1, followed.surface + 1)?;
        writeln!(out, "parameter = {}", quoted(&parameter))?;
        // The nearest number need not read back as the same bits: look for one that does.
        let offset = followed.number.stated_difference(p.offset);
        let reads_back = |o: f64| followed.number.from_stated_difference(o).to_bits() == p.offset.to_bits();
        let offset = shortest(offset, reads_back).unwrap_or(offset);
        writeln!(out, "scale = {}\noffset = {}", number(p.scale), number(offset))?;
    }
    if file.efl_solve.is_some() || file.magnification_solve.is_some() || file.length_solve.is_some() {
        writeln!(out, "\n[solve]")?;
    }
    if let Some((surface, length_mm)) = file.length_solve {
        writeln!(out, "length = {{ surface = {}, length_mm = {} }}", surface + 1, number(length_mm))?;
    }
    let bounds = |radius_mm: Option<[f64; 2]>| match radius_mm {
        Some([min, max]) => format!(", radius_mm = [{}, {}]", number(min), number(max)),
        None => String::new(),
    };
    if let Some(solve) = &file.efl_solve {
        let (surface, efl_mm, bounds) = (solve.surface + 1, number(solve.efl_mm), bounds(solve.radius_mm));
        writeln!(out, "efl = {{ surface = {surface}, efl_mm = {efl_mm}{bounds} }}")?;
    }
    if let Some(solve) = &file.magnification_solve {
        let (surface, bounds) = (solve.surface + 1, bounds(solve.radius_mm));
        let magnification = number(solve.magnification);
        writeln!(out, "magnification = {{ surface = {surface}, magnification = {magnification}{bounds} }}")?;
    }
    let Some(expect) = &file.expect else { return Ok(()) };
    writeln!(out, "\n[expect]")?;
    for (key, expected) in [
        ("efl_mm", expect.efl_mm),
        ("bfl_mm", expect.bfl_mm),
        ("f_number", expect.f_number),
        ("total_track_mm", expect.total_track_mm),
    ] {
        if let Some(Expected { value, tolerance }) = expected {
            let (value, tolerance) = (number(value), number(tolerance));
            writeln!(out, "{key} = {{ value = {value}, tolerance = {tolerance} }}")?;
        }
    }
    if let Some(spots) = &expect.rms_spot_um {
        let (values, tolerance) = (numbers(&spots.values_um), number(spots.relative_tolerance));
        writeln!(out, "rms_spot_um = {{ values = {values}, relative_tolerance = {tolerance} }}")?;
    }
    Ok(())
}

/// The materials of the lens with unique names, even if different glasses have the same name.
fn named_glasses(lens: &Lens) -> Vec<(String, &Glass)> {
    let mut named: Vec<(String, &Glass)> = Vec::new();
    for surface in &lens.surfaces {
        let glass = surface.glass.as_ref();
        if *glass == *Glass::air() || named.iter().any(|(_, known)| *known == glass) {
            continue;
        }
        let taken = |name: &str| {
            let name = name.to_uppercase();
            name == "AIR" || named.iter().any(|(known, _)| known.to_uppercase() == name)
        };
        let mut name = glass.name.clone();
        let mut copy = 1;
        while taken(&name) {
            copy += 1;
            name = format!("{}-{copy}", glass.name);
        }
        named.push((name, glass));
    }
    named
}

fn write_surface(
    surface: &Surface,
    stop: bool,
    glasses: &[(String, &Glass)],
    out: &mut String,
) -> std::fmt::Result {
    writeln!(out, "\n[[surface]]")?;
    if !surface.label.is_empty() {
        writeln!(out, "label = {}", quoted(&surface.label))?;
    }
    if stop {
        writeln!(out, "stop = true")?;
    }
    let shape = &surface.shape;
    match exact_reciprocal(shape.curvature) {
        Some(radius_mm) => writeln!(out, "radius_mm = {}", number(radius_mm))?,
        None => {
            let (curvature, about_mm) = (number(shape.curvature), 1.0 / shape.curvature);
            writeln!(out, "curvature_per_mm = {curvature} # radius {about_mm:.6} mm")?;
        }
    }
    if shape.conic.to_bits() != 0 {
        writeln!(out, "conic = {}", number(shape.conic))?;
    }
    let terms = named((0..).zip(shape.asphere).map(|(i, a)| (format!("a{}", 2 * i + 2), a)));
    if !terms.is_empty() {
        writeln!(out, "asphere = {{ {} }}", terms.join(", "))?;
    }
    out.push_str(&special_lines(surface));
    writeln!(out, "thickness_mm = {}", number(surface.thickness_mm))?;
    if surface.action != Action::Reflect
        && let Some((name, _)) = glasses.iter().find(|(_, glass)| **glass == *surface.glass)
    {
        writeln!(out, "glass = {}", quoted(name))?;
    }
    writeln!(out, "semi_diameter_mm = {}", number(surface.semi_diameter_mm))?;
    if surface.is_open { writeln!(out, "open = true") } else { Ok(()) }
}

/// Everything of a surface except its conic, its even polynomial, its glass and its thickness, as lines of a lens file. Empty
/// for an ordinary surface.
pub fn special_lines(surface: &Surface) -> String {
    let mut out = departure_line(&surface.shape.departure) + &action_lines(surface);
    if let Some(placement) = &surface.placement {
        out += &placement_line(placement);
        out.push('\n');
    }
    out
}

/// The line of a departure; empty for none.
fn departure_line(departure: &Departure) -> String {
    let values = departure.numbers();
    match departure {
        Departure::None => String::new(),
        Departure::Odd(b) => {
            let terms = named((0..).zip(b).map(|(i, b)| (format!("b{}", 2 * i + 1), *b)));
            format!("odd = {{ {} }}\n", terms.join(", "))
        }
        Departure::Xy { norm_radius_mm, .. } => {
            let mut terms = vec![format!("norm_radius_mm = {}", number(*norm_radius_mm))];
            terms.extend(named(xy_powers().zip(values).map(|((i, j), b)| (format!("x{i}y{j}"), b))));
            format!("xy = {{ {} }}\n", terms.join(", "))
        }
        Departure::Qbfs { norm_radius_mm, .. } | Departure::Qcon { norm_radius_mm, .. } => {
            let key = if matches!(departure, Departure::Qbfs { .. }) { "q_bfs" } else { "q_con" };
            let (h, a) = (number(*norm_radius_mm), numbers(trimmed(&values)));
            format!("{key} = {{ norm_radius_mm = {h}, a = {a} }}\n")
        }
        Departure::Biconic { curvature_x, conic_x } => {
            let section = reciprocal(["radius_x_mm", "curvature_x_per_mm"], *curvature_x);
            format!("biconic = {{ {section}, conic_x = {} }}\n", number(*conic_x))
        }
        Departure::Toroid { curvature_x } => {
            format!("toroid = {{ {} }}\n", reciprocal(["radius_x_mm", "curvature_x_per_mm"], *curvature_x))
        }
    }
}

/// The lines of a surface's action on light.
fn action_lines(surface: &Surface) -> String {
    let mut out = match surface.action {
        Action::Refract => String::new(),
        Action::Reflect => "mirror = true\n".to_owned(),
        Action::ThinLens { power_per_mm } => {
            format!("thin_lens = {{ {} }}\n", reciprocal(["focal_length_mm", "power_per_mm"], power_per_mm))
        }
    };
    match surface.phase {
        None => {}
        Some(Phase { order, pattern: Pattern::Grating { lines_per_mm } }) => {
            out += &format!("grating = {{ lines_per_mm = {}, order = {order} }}\n", number(lines_per_mm));
        }
        Some(Phase { order, pattern: Pattern::Binary { norm_radius_mm, coefficients_rad } }) => {
            let (h, a) = (number(norm_radius_mm), numbers(trimmed(&coefficients_rad)));
            out += &format!("binary = {{ norm_radius_mm = {h}, order = {order}, a_rad = {a} }}\n");
        }
    }
    out
}

fn placement_line(placement: &Placement) -> String {
    let degrees = placement.tilt_rad.map(exact_degrees);
    let tilt = match degrees {
        [Some(x), Some(y), Some(z)] => format!("tilt_deg = {}", numbers(&[x, y, z])),
        _ => format!("tilt_rad = {}", numbers(&placement.tilt_rad)),
    };
    let axis = match placement.axis {
        Axis::Returns => "returns",
        Axis::Follows => "follows",
        Axis::Bends => "bends",
    };
    let decenter = numbers(&placement.decenter_mm);
    format!("placement = {{ decenter_mm = {decenter}, {tilt}, axis = \"{axis}\" }}")
}

/// Terms that are not zero, as `name = value`. Negative zero is written, because its bits differ from the default 0.
fn named(terms: impl Iterator<Item = (String, f64)>) -> Vec<String> {
    let said = terms.filter(|(_, v)| v.to_bits() != 0);
    said.map(|(name, v)| format!("{name} = {}", number(v))).collect()
}

/// The values without the zeros at the end.
fn trimmed(values: &[f64]) -> &[f64] {
    let count = values.iter().rposition(|v| v.to_bits() != 0).map_or(0, |last| last + 1);
    &values[..count]
}

/// A number as its reciprocal if that is exact, else the number itself.
fn reciprocal([reciprocal_key, key]: [&str; 2], value: f64) -> String {
    match exact_reciprocal(value) {
        Some(reciprocal) => format!("{reciprocal_key} = {}", number(reciprocal)),
        None => format!("{key} = {}", number(value)),
    }
}
