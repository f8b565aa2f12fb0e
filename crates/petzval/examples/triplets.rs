//! The figures and tables of the chapter on the seven triplets of the end-to-end camera paper.
//!
//! `cargo run --release -p petzval --example triplets -- book/src/images/triplets` writes the pictures there and prints the tables.

use std::path::Path;

use petzval::built_in_assets;
use petzval::optics::analysis::{
    Analysis, AnalysisOptions, FieldMtf, Layout, MtfCurve, analyze, first_order_table, layout,
};
use petzval::optics::lens::Lens;
use petzval::optics::solve::with_paraxial_focus;
use petzval::report::layout::{CrossSection, Extent};
use petzval::report::lens_sheet::{Picture, spots_in_boxes};

/// Half a cycle on two pixels of 5.86 um, cycles/mm.
const NYQUIST_PER_MM: f64 = 85.32;

/// Sides of the boxes of spots in the paper, um: sensor-sized field and larger field.
const BOX_UM: [f64; 2] = [200.0, 400.0];

/// Half the diagonals of the sensors, mm: 1920 x 1200 and 3480 x 2400 pixels of 5.86 um.
const HALF_DIAGONAL_MM: [f64; 2] = [6.634, 12.386];

/// Fields of the larger field of view, degrees.
const LARGE_DEG: [f64; 4] = [0.0, 5.0, 15.0, 25.0];

/// Width of a layout, px.
const LAYOUT_PX: f64 = 860.0;

/// A triplet with what table 13 prints of it: focal length, f-number, back focal length, track.
struct Triplet {
    name: &'static str,
    printed: [f64; 4],
    is_large: bool,
}

const TRIPLETS: [Triplet; 7] = [
    Triplet { name: "nominal", printed: [25.0, 4.4, 24.4, 46.6], is_large: false },
    Triplet { name: "pedestrian-vehicle", printed: [18.5, 3.2, 24.9, 52.2], is_large: false },
    Triplet { name: "traffic-light", printed: [18.8, 3.3, 24.1, 52.3], is_large: false },
    Triplet { name: "image-quality-hardware-isp", printed: [33.1, 5.8, 35.0, 56.4], is_large: false },
    Triplet { name: "image-quality-software-isp", printed: [32.8, 5.8, 34.6, 53.8], is_large: false },
    Triplet { name: "large-fov-hardware-isp", printed: [35.4, 6.2, 39.8, 60.3], is_large: true },
    Triplet { name: "large-fov-software-isp", printed: [32.8, 5.8, 34.6, 53.8], is_large: true },
];

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let out = std::env::args().nth(1).ok_or("a folder for the pictures")?;
    let out = Path::new(&out);
    std::fs::create_dir_all(out)?;
    let assets = built_in_assets();
    let mut lenses: Vec<Lens> = Vec::new();
    for triplet in &TRIPLETS {
        lenses.push(assets.lens(&format!("cooke-triplet-{}", triplet.name))?.lens);
    }
    layouts(&lenses, out)?;
    properties(&lenses);
    let mut seen: Vec<(String, Analysis)> = Vec::new();
    let mut at_paraxial_focus: Vec<(String, Analysis)> = Vec::new();
    for (triplet, lens) in TRIPLETS.iter().zip(&lenses) {
        seen.push((triplet.name.into(), show(triplet.name, lens, triplet.is_large, out)?));
        let paraxial = with_paraxial_focus(lens, 0.0);
        at_paraxial_focus.push((triplet.name.into(), analyze(&paraxial, &options(), &|| Ok(()))?));
    }
    // The nominal lens at the larger field, its mounts opened: they were sized for 15 degrees.
    let mut wide = Lens { fields_deg: LARGE_DEG.to_vec(), ..lenses[0].clone() };
    wide.name += ", opened for 25 degrees";
    wide.surfaces.iter_mut().for_each(|s| s.semi_diameter_mm *= 1.3);
    seen.push(("nominal, opened".into(), show("nominal-large", &wide, true, out)?));
    println!("In the image planes of the files:\n");
    modulation(&seen);
    println!("\nIn the paraxial image planes:\n");
    modulation(&at_paraxial_focus);
    Ok(())
}

/// All layouts on one scale, figure 26.
fn layouts(lenses: &[Lens], out: &Path) -> Result<(), Failure> {
    let fan = AnalysisOptions { layout_rays: 5, ..AnalysisOptions::default() };
    let sections: Vec<Layout> = lenses.iter().map(|lens| layout(lens, &fan)).collect();
    let drawing = |i: usize| CrossSection {
        name: &lenses[i].name,
        layout: &sections[i],
        fields_deg: &lenses[i].fields_deg,
        half_diagonal_mm: HALF_DIAGONAL_MM[usize::from(TRIPLETS[i].is_large)],
        ghost: None,
    };
    let extent = (0..lenses.len()).map(|i| drawing(i).extent()).fold(Extent::default(), Extent::union);
    let px_per_mm = LAYOUT_PX / (extent.z_max_mm - extent.z_min_mm);
    for (i, triplet) in TRIPLETS.iter().enumerate() {
        let (name, svg) = (triplet.name, drawing(i).svg(px_per_mm, extent));
        let white = svg.replacen('>', "><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>", 1);
        std::fs::write(out.join(format!("layout-{name}.svg")), white)?;
    }
    Ok(())
}

fn options() -> AnalysisOptions {
    AnalysisOptions {
        max_frequency_per_mm: Some(NYQUIST_PER_MM),
        frequency_points: 69,
        spot_rings: 6,
        ..AnalysisOptions::default()
    }
}

/// MTF and spots of a lens, figures 27 to 30.
fn show(name: &str, lens: &Lens, is_large: bool, out: &Path) -> Result<Analysis, Failure> {
    let analysis = analyze(lens, &options(), &|| Ok(()))?;
    std::fs::write(
        out.join(format!("mtf-{name}.svg")),
        Picture::named("mtf").ok_or("no such picture")?.svg(&analysis),
    )?;
    let side_um = BOX_UM[usize::from(is_large)];
    std::fs::write(out.join(format!("spots-{name}.svg")), spots_in_boxes(&analysis, side_um))?;
    Ok(analysis)
}

/// Table 13: printed and reconstructed. Tracks count to the paraxial focus.
fn properties(lenses: &[Lens]) {
    println!("| design | EFL, mm | f-number | BFL, mm | track, mm |");
    println!("|---|---|---|---|---|");
    for (triplet, lens) in TRIPLETS.iter().zip(lenses) {
        let order = first_order_table(lens);
        let nan = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let track = order.total_track_mm - nan(order.defocus_mm);
        let [efl, f_number, bfl, total] = triplet.printed;
        println!(
            "| {} | {:.2} ({efl:.1}) | {:.2} ({f_number:.1}) | {:.2} ({bfl:.1}) | {track:.2} ({total:.1}) |",
            triplet.name,
            nan(order.efl_mm),
            nan(order.f_number),
            nan(order.bfl_mm),
        );
    }
    println!();
}

/// The curve that is shown.
fn shown(mtf: &FieldMtf) -> &MtfCurve {
    mtf.diffraction.as_ref().unwrap_or(&mtf.geometric)
}

/// Modulation nearest to a frequency, T/S.
fn at(mtf: &FieldMtf, frequency: f64) -> [f64; 2] {
    let off = |i: &usize| (mtf.frequency_per_mm[*i] - frequency).abs();
    let i = (0..mtf.frequency_per_mm.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
    [shown(mtf).tangential[i], shown(mtf).sagittal[i]]
}

/// Numbers to go with the curves.
fn modulation(seen: &[(String, Analysis)]) {
    println!("| design | field | RMS spot, um | MTF at 25, T / S | at 50 | at 77.8 | at 85.32 |");
    println!("|---|---|---|---|---|---|---|");
    for (name, analysis) in seen {
        for (i, mtf) in analysis.mtf.iter().enumerate() {
            let pair = |frequency: f64| {
                let [t, s] = at(mtf, frequency);
                format!("{t:.2} / {s:.2}")
            };
            let by_rays = if mtf.diffraction.is_none() { " (rays)" } else { "" };
            println!(
                "| {} | {}°{by_rays} | {:.1} | {} | {} | {} | {} |",
                if i == 0 { name.as_str() } else { "" },
                mtf.field_deg,
                analysis.spots[i].rms_um,
                pair(25.0),
                pair(50.0),
                pair(77.8),
                pair(NYQUIST_PER_MM),
            );
        }
    }
}
