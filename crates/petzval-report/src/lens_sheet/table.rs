//! Tables: first order, the fields at a glance, third-order sums by surface.

use maud::{Markup, html};
use petzval_optics::analysis::{Analysis, ThirdOrderSurface};

use super::seidel::{SUMS, sums};
use super::style::{field_name, method, short, wavelength_name};
use super::wavefront::nearest_to_reference;
use crate::number;
use crate::page::{caption, facts};
use crate::table::{Column, Row, Table};

/// First-order quantities as a list of two columns, without those that do not exist.
pub(super) fn first_order(analysis: &Analysis) -> Markup {
    let o = &analysis.first_order;
    let mm = |v: Option<f64>| v.map(|v| format!("{} mm", number::fixed(v, 4)));
    let plain = |v: Option<f64>, decimals: usize| v.map(|v| number::fixed(v, decimals));
    let rows: [(&str, Option<String>); 24] = [
        ("focal length", mm(o.efl_mm)),
        ("back focal length", mm(o.bfl_mm)),
        ("front focal length", mm(o.ffl_mm)),
        ("f-number", plain(o.f_number, 3)),
        ("numerical aperture at the image", plain(Some(o.image_na), 4)),
        ("working f-number, 1 / (2 NA)", plain(o.working_f_number, 3)),
        ("field of NA, Airy disk and cutoff", o.image_na_field_deg.map(field_name)),
        ("object from the first vertex", Some(mm(o.object_mm).unwrap_or_else(|| "at infinity".into()))),
        ("magnification", plain(o.magnification, 4)),
        ("full field", Some(field_name(o.full_field_deg))),
        ("height of the paraxial image", mm(o.image_height_mm)),
        ("image plane from the last vertex", mm(Some(o.image_mm))),
        ("image plane from the paraxial image", mm(o.defocus_mm)),
        ("total track to the image plane", mm(Some(o.total_track_mm))),
        ("entrance pupil, diameter", mm(Some(o.entrance_pupil_mm))),
        ("entrance pupil from the first vertex", mm(o.entrance_pupil_at_mm)),
        ("exit pupil, diameter", mm(o.exit_pupil_mm)),
        ("exit pupil from the last vertex", mm(o.exit_pupil_at_mm)),
        ("stop, radius", mm(Some(o.stop_radius_mm))),
        ("Petzval radius", mm(o.petzval_radius_mm)),
        ("Lagrange invariant", mm(o.lagrange_invariant_mm)),
        ("Airy disk, radius", o.airy_radius_um.map(|radius| format!("{} µm", number::fixed(radius, 3)))),
        ("cutoff", Some(format!("{} cycles/mm", number::fixed(o.cutoff_per_mm, 1)))),
        ("reference wavelength", Some(wavelength_name(analysis.reference_um))),
    ];
    facts(rows)
}

/// One line a field.
pub(super) fn by_field(analysis: &Analysis) -> Markup {
    let shown = nearest_to_reference(analysis);
    let highest = analysis.mtf.first().and_then(|m| m.frequency_per_mm.last()).copied().unwrap_or(0.0);
    let um = analysis.wavelengths_um.get(shown).copied().unwrap_or(f64::NAN);
    let has_waves: Vec<bool> = analysis.mtf.iter().map(|m| m.diffraction.is_some()).collect();
    let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
    let columns = [
        Column::new("field"),
        Column::new("chief ray y").unit("mm"),
        Column::new("RMS spot").unit("µm"),
        Column::new("largest").unit("µm"),
        Column::new("RMS wavefront").unit("waves"),
        Column::new("P–V").unit("waves"),
        Column::new("Strehl").unit("ratio"),
        Column::new("MTF T").unit(format!("at {}", short(highest, 2))),
        Column::new("MTF S").unit("cycles/mm"),
    ];
    let row = |(i, field): (usize, &f64)| {
        let (spot, wave, mtf) = (&analysis.spots[i], &analysis.wavefronts[i], &analysis.mtf[i]);
        let curve = mtf.diffraction.as_ref().unwrap_or(&mtf.geometric);
        let cells = [
            number::fixed(spot.chief_mm[1], 4),
            number::fixed(spot.rms_um, 2),
            number::fixed(spot.geometric_radius_um, 2),
            number::fixed(wave.rms_waves[shown], 3),
            number::fixed(wave.peak_to_valley_waves[shown], 2),
            number::fixed(wave.strehl[shown].unwrap_or(f64::NAN), 3),
            number::fixed(last(&curve.tangential), 3),
            number::fixed(last(&curve.sagittal), 3),
        ];
        Row::new(field_name(*field), cells)
    };
    let table = Table::new(columns).rows(analysis.fields_deg.iter().enumerate().map(row));
    html! {
        (table.html())
        (caption(format!(
            "Spots of all wavelengths about their common centroid; wavefronts at {}. MTF: {}; mean of the wavelengths.",
            wavelength_name(um),
            method(&has_waves).to_lowercase()
        )))
    }
}

/// Third-order sums by surface; empty if third-order theory does not cover the lens.
pub(super) fn third_order(analysis: &Analysis) -> Markup {
    let Some(order) = &analysis.third_order else { return html! {} };
    let cells = |of: &ThirdOrderSurface| sums(of).map(|v| number::fixed(v, 5));
    let columns = SUMS.iter().map(|(sum, name)| Column::new(*sum).unit(*name));
    let surfaces = order.surfaces.iter().enumerate().map(|(i, s)| Row::new((i + 1).to_string(), cells(s)));
    let table = Table::new([Column::new("surface")].into_iter().chain(columns))
        .rows(surfaces)
        .rows([Row::new("sum, mm", cells(&order.total)).class("sum")]);
    let [w040, w131, w222, w220, w311] = order.wavefront_waves.map(|w| number::fixed(w, 3));
    html! {
        (table.html())
        (caption(format!(
            "As wavefronts at the edge of pupil and field, waves: W040 {w040}, W131 {w131}, W222 {w222}, W220 {w220}, W311 {w311}."
        )))
    }
}
