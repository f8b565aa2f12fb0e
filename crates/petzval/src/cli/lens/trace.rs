//! `petzval lens trace`: one ray through every surface.

use std::process::ExitCode;

use clap::ValueEnum;
use petzval::built_in_assets;
use petzval::optics::lens::{Lens, ObjectDistance};
use petzval::optics::paraxial::first_order;
use petzval::optics::pupil::paraxial_launch;
use petzval::optics::trace::{Fate, aim_at_stop, launch, trace_ray};
use serde_json::{Value, json};

use crate::cli::{Failure, print_json};

/// How a ray finds its place in the pupil.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Aim {
    /// Through that point of the real stop.
    Real,
    /// Through that point of the paraxial entrance pupil.
    Paraxial,
}

/// Trace one ray and print where it passes every surface.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Field angle, degrees
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    field: f64,
    /// Wavelength, um
    #[arg(long, value_name = "UM")]
    wavelength: f64,
    /// Point of the pupil, in units of its radius
    #[arg(long, value_name = "PX,PY", value_delimiter = ',', required = true, allow_hyphen_values = true)]
    pupil: Vec<f64>,
    /// What the pupil point lies on
    #[arg(long, value_enum, default_value = "real")]
    aim: Aim,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let [px, py] = args.pupil[..] else {
        return Err(Failure::input("--pupil needs two numbers", "for example --pupil 0,0.7"));
    };
    if !(px.is_finite() && py.is_finite()) {
        return Err(Failure::input("--pupil: not two finite numbers", "for example --pupil 0,0.7"));
    }
    if !(0.2..=20.0).contains(&args.wavelength) {
        return Err(Failure::input(
            format!("--wavelength {}: not between 0.2 and 20 um", args.wavelength),
            format!("wavelengths are in um; did you mean {}?", args.wavelength * 1e-3),
        ));
    }
    if !args.field.is_finite() || args.field.abs() >= 89.0 {
        return Err(Failure::input(format!("--field {}: not within 89 degrees", args.field), "degrees"));
    }
    let lens = built_in_assets().lens(&args.lens)?.lens;
    let traced = trace(&lens, args, [px, py]);
    if args.json {
        return print_json(&traced);
    }
    println!("status: {}", traced["status"].as_str().unwrap_or(""));
    println!("{:>8} {:>14} {:>14} {:>14} {:>12} {:>12} {:>12}", "", "x mm", "y mm", "z mm", "l", "m", "n");
    let row = |name: &str, v: &Value| {
        let f = |key: &str| v[key].as_f64().unwrap_or(f64::NAN);
        println!(
            "{name:>8} {:>14.9} {:>14.9} {:>14.9} {:>12.9} {:>12.9} {:>12.9}",
            f("x_mm"),
            f("y_mm"),
            f("z_mm"),
            f("l"),
            f("m"),
            f("n")
        );
    };
    for (i, s) in traced["surfaces"].as_array().into_iter().flatten().enumerate() {
        row(&(i + 1).to_string(), s);
    }
    if traced["image"].is_object() {
        row("image", &traced["image"]);
        println!("optical path: {:.9} mm", traced["opl_mm"].as_f64().unwrap_or(f64::NAN));
    }
    Ok(ExitCode::SUCCESS)
}

fn trace(lens: &Lens, args: &Args, pupil: [f64; 2]) -> Value {
    let sequence = lens.at_wavelength(args.wavelength);
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let field = args.field.to_radians();
    let guess = paraxial_launch(&order, &sequence, field, pupil);
    let at = match args.aim {
        Aim::Paraxial => Some(guess),
        Aim::Real => {
            let target = pupil.map(|p| p * order.stop_radius_mm);
            aim_at_stop(&sequence, field, target, guess).map(|aimed| aimed.launch_mm)
        }
    };
    let Some(at) = at else {
        return json!({ "status": status(Fate::NotAimed), "surfaces": [], "image": null, "opl_mm": null });
    };
    let start = launch(&sequence, field, at).ray;
    let path = trace_ray(&sequence, start);
    let place = |p: [f64; 3], d: [f64; 3]| json!({ "x_mm": p[0], "y_mm": p[1], "z_mm": p[2], "l": d[0], "m": d[1], "n": d[2] });
    // A direction is that of the ray as a line; behind an odd number of mirrors light goes the other way along it.
    let along_light = |d: [f64; 3], n: f64| d.map(|v| v * n.signum());
    let surfaces: Vec<Value> = path
        .passages
        .iter()
        .zip(&sequence.surfaces)
        .map(|(p, s)| place(p.point, along_light(p.direction_after, s.n_after)))
        .collect();
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    // From infinity the path counts from the plane of the first vertex; from an object, from the object.
    let before = match lens.object {
        ObjectDistance::Infinity => 0.0,
        ObjectDistance::Finite(distance) => distance / start.direction[2],
    };
    json!({
        "status": status(path.fate),
        "surfaces": surfaces,
        "image": path.image.map(|ray| place(ray.position, along_light(ray.direction, n_image))),
        "opl_mm": path.image.map(|_| before + path.optical_path_mm),
    })
}

fn status(fate: Fate) -> String {
    match fate {
        Fate::Ok => "ok".into(),
        Fate::Missed(i) => format!("missed surface {}", i + 1),
        Fate::Clipped(i) => format!("clipped at surface {}", i + 1),
        Fate::TotalReflection(i) => format!("total internal reflection at surface {}", i + 1),
        Fate::NotAimed => "no ray passes this point of the stop".into(),
    }
}
