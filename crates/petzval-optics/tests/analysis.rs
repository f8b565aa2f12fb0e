//! Analyses against formulas, against each other and against Huygens's wavelets.

mod built_in;
mod common;

use std::f64::consts::{PI, TAU};

use common::{bessel_j1, nearly_telecentric, nominal_triplet, paraboloid, special_lenses};
use petzval_optics::analysis::{
    AnalysisOptions, LayoutElement, analyze, axial_colour, encircled_energy, fan, field_curves, field_mtf,
    first_order_table, layout, longitudinal_aberration, mtf_by_field, spot_diagram, third_order,
    through_focus_mtf, wavefront,
};
use petzval_optics::lens::{Action, Axis, Lens, ObjectDistance, Placement, Surface};
use petzval_optics::merit::{FieldSet, Merit, Mtf, RmsWavefront};
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::PsfKind;
use petzval_optics::pupil::Quadrature;
use petzval_optics::solve::with_paraxial_focus;
use petzval_optics::wave::huygens_psf;

/// A lens without aberration on its axis, in one colour and at that field alone.
fn perfect(f_number: f64) -> Lens {
    Lens { wavelengths_um: vec![0.5], reference_um: 0.5, fields_deg: vec![0.0], ..paraboloid(f_number) }
}

/// A thin lens in the stop, perfect on its axis.
fn thin(f_number: f64) -> Lens {
    let mut lens = perfect(f_number);
    let f = f_number * lens.entrance_pupil_mm;
    lens.surfaces = vec![Surface {
        action: Action::ThinLens { power_per_mm: 1.0 / f },
        thickness_mm: f,
        semi_diameter_mm: 11.0,
        ..Surface::default()
    }];
    lens
}

fn options() -> AnalysisOptions {
    AnalysisOptions::default()
}

#[test]
fn the_mtf_of_a_perfect_lens_equals_that_of_a_disk() {
    // Slow enough for the light to be even over the direction cosines, as the formula has it.
    for f_number in [8.0, 16.0] {
        let lens = perfect(f_number);
        // 2 NA / wavelength, with the sine of the marginal ray of the paraboloid.
        let sine = (2.0 * (0.25 / f_number).atan()).sin();
        let cutoff = 2.0 * sine / 0.5e-3;
        let options = AnalysisOptions { max_frequency_per_mm: Some(1.1 * cutoff), ..options() };
        let mtf = field_mtf(&lens, 0.0, &options).unwrap();
        let (found, limit) = (mtf.diffraction.unwrap(), mtf.limit.unwrap());
        for (k, f) in mtf.frequency_per_mm.iter().enumerate() {
            let v = (f / cutoff).min(1.0);
            let wanted = 2.0 / PI * (v.acos() - v * (1.0 - v * v).sqrt());
            for modulation in [found.sagittal[k], found.tangential[k], limit.sagittal[k], limit.tangential[k]]
            {
                assert!((modulation - wanted).abs() < 1e-3, "f/{f_number} {v}: {modulation} {wanted}");
            }
        }
        assert!((first_order_table(&lens).cutoff_per_mm / cutoff - 1.0).abs() < 0.005);
    }
}

/// Modulation of a sampled PSF in both sections (sagittal, tangential).
fn modulation(values: &[f64], grid: usize, pitch_mm: f64, frequency: f64) -> [f64; 2] {
    let total: f64 = values.iter().sum();
    [0, 1].map(|axis| {
        let (mut re, mut im) = (0.0, 0.0);
        for (c, v) in values.iter().enumerate() {
            let place = if axis == 0 { c % grid } else { c / grid } as f64 * pitch_mm;
            let (sin, cos) = (TAU * frequency * place).sin_cos();
            re += v * cos;
            im += v * sin;
        }
        f64::hypot(re, im) / total
    })
}

#[test]
fn the_mtf_equals_that_of_huygens_wavelets() {
    // Grids that hold nearly all light: of a diffracted beam some is always outside. The sampling frequency less the cutoff is above
    // 100 / mm, so that nothing aliases onto the frequencies compared.
    let slow = Lens { entrance_pupil_mm: 2.0, ..nominal_triplet() };
    let fine = (2.0, 90);
    let mut lenses =
        vec![(nominal_triplet(), 0.0, fine), (nominal_triplet(), 14.0, fine), (slow, 10.0, (4.0, 126))];
    let tilted = special_lenses().into_iter().filter(|l| l.name.contains("tilted in"));
    lenses.extend(tilted.map(|l| (l, 5.0, fine)));
    for (mut lens, field_deg, (pitch_um, grid)) in lenses {
        lens.wavelengths_um = vec![lens.reference_um];
        let options =
            AnalysisOptions { max_frequency_per_mm: Some(100.0), frequency_points: 11, ..options() };
        let mtf = field_mtf(&lens, field_deg, &options).unwrap().diffraction.unwrap();
        let sequence = lens.at_wavelength(lens.reference_um);
        let quadrature = Quadrature::grid(96).unwrap();
        let psf = huygens_psf(&sequence, field_deg.to_radians(), &quadrature, grid, pitch_um).unwrap();
        for (k, f) in [(1, 10.0), (3, 30.0), (5, 50.0), (10, 100.0)] {
            let [sagittal, tangential] = modulation(&psf, grid, 1e-3 * pitch_um, f);
            let off = (mtf.sagittal[k] - sagittal).abs().max((mtf.tangential[k] - tangential).abs());
            assert!(off < 0.01, "{} {field_deg} {f}: {off}", lens.name);
        }
    }
}

#[test]
fn the_geometric_mtf_of_a_defocused_thin_lens_is_that_of_a_disk() {
    let mut lens = thin(4.0);
    // A disk of radius defocus / (2 N): MTF = |2 J1(a) / a|, a = 2 pi f r.
    lens.surfaces[0].thickness_mm += 0.4;
    let options = AnalysisOptions { max_frequency_per_mm: Some(40.0), pupil_cells: 128, ..options() };
    let mtf = field_mtf(&lens, 0.0, &options).unwrap();
    for (k, f) in mtf.frequency_per_mm.iter().enumerate().skip(1) {
        let a = TAU * f * 0.05;
        let wanted = (2.0 * bessel_j1(a) / a).abs();
        for found in [mtf.geometric.sagittal[k], mtf.geometric.tangential[k]] {
            assert!((found - wanted).abs() < 1e-3, "{f}: {found} {wanted}");
        }
    }
}

#[test]
fn rays_and_waves_agree_for_aberrations_of_many_waves() {
    // Diffraction takes off no more than it does of a perfect lens.
    let mut lens = nominal_triplet();
    lens.surfaces[6].thickness_mm += 0.3;
    let options = AnalysisOptions { max_frequency_per_mm: Some(12.0), pupil_cells: 128, ..options() };
    for field in [0.0, 5.0, 10.0] {
        let mtf = field_mtf(&lens, field, &options).unwrap();
        let (waves, limit) = (mtf.diffraction.unwrap(), mtf.limit.unwrap());
        for k in 0..mtf.frequency_per_mm.len() {
            for (g, w, l) in [
                (mtf.geometric.sagittal[k], waves.sagittal[k], limit.sagittal[k]),
                (mtf.geometric.tangential[k], waves.tangential[k], limit.tangential[k]),
            ] {
                assert!((g - w).abs() < 1.0 - l + 2e-3, "{field} {}: {g} {w} {l}", mtf.frequency_per_mm[k]);
            }
        }
    }
    // In light of a very short wavelength they are the same, through the zeros of a defocused disk.
    let mut lens = perfect(8.0);
    lens.surfaces[0].thickness_mm -= 0.3;
    (lens.wavelengths_um, lens.reference_um) = (vec![0.01], 0.01);
    let options = AnalysisOptions { max_frequency_per_mm: Some(60.0), pupil_cells: 128, ..options };
    let mtf = field_mtf(&lens, 0.0, &options).unwrap();
    let waves = mtf.diffraction.unwrap();
    assert!(mtf.geometric.sagittal.iter().any(|m| *m < 0.02));
    for (g, w) in mtf.geometric.sagittal.iter().zip(&waves.sagittal) {
        assert!((g - w).abs() < 5e-3, "{g} {w}");
    }
}

#[test]
fn the_contrast_merit_by_waves_is_the_analysed_mtf() {
    let lens = nominal_triplet();
    let frequencies = [5.0, 20.0, 60.0, 120.0];
    let options = AnalysisOptions { max_frequency_per_mm: Some(120.0), frequency_points: 25, ..options() };
    for field in [0.0, 5.0, 10.0] {
        let mtf = field_mtf(&lens, field, &options).unwrap();
        let waves = mtf.diffraction.unwrap();
        for frequency in frequencies {
            let k = mtf.frequency_per_mm.iter().position(|f| (f - frequency).abs() < 1e-9).unwrap();
            let expected = 0.5 * (waves.sagittal[k] + waves.tangential[k]);
            let fields = FieldSet::new(&lens, &[field]);
            let merit = Mtf::new(&lens, frequency, PsfKind::Diffraction).with_fields(fields);
            let found = merit.value(&lens).unwrap();
            assert!((found - expected).abs() < 3e-3, "{field} {frequency}: {found} {expected}");
        }
    }
}

/// Far out of focus a few rays land near the chief ray, on a grid of pupil cells; they must not pass for the whole light.
#[test]
fn the_contrast_merit_by_rays_counts_the_light_beyond_its_grid() {
    let sharp = nominal_triplet();
    let value = |off_mm: f64| {
        let lens = sharp.with_image_distance(sharp.image_distance_mm() + off_mm);
        let merit = Mtf::new(&lens, 40.0, PsfKind::Geometric).with_fields(FieldSet::new(&lens, &[0.0]));
        merit.value(&lens).unwrap()
    };
    assert!(value(0.0) > 0.7, "{}", value(0.0));
    // A disk of more than a millimetre: 1 % of its light or less is on the grid of 0.2 mm.
    for off_mm in [10.0, 20.0, -10.0] {
        assert!(value(off_mm) < 0.02, "{off_mm}: {}", value(off_mm));
    }
}

#[test]
fn through_focus_is_refocusing() {
    let lens = nominal_triplet();
    let options = AnalysisOptions {
        focus_range_mm: Some(0.2),
        focus_points: 5,
        focus_frequency_per_mm: Some(30.0),
        max_frequency_per_mm: Some(30.0),
        frequency_points: 2,
        ..options()
    };
    for field in [0.0, 10.0] {
        let through = through_focus_mtf(&lens, field, &options).unwrap();
        let waves = through.diffraction.unwrap();
        assert!(
            through.defocus_mm.iter().zip([-0.2, -0.1, 0.0, 0.1, 0.2]).all(|(a, b)| (a - b).abs() < 1e-12)
        );
        for (k, dz) in through.defocus_mm.iter().enumerate() {
            let moved = lens.with_image_distance(lens.image_distance_mm() + dz);
            let there = field_mtf(&moved, field, &options).unwrap();
            let direct = there.diffraction.unwrap();
            assert!((through.geometric.sagittal[k] - there.geometric.sagittal[1]).abs() < 1e-9);
            assert!((through.geometric.tangential[k] - there.geometric.tangential[1]).abs() < 1e-9);
            let off = [waves.sagittal[k] - direct.sagittal[1], waves.tangential[k] - direct.tangential[1]];
            assert!(off.iter().all(|v| v.abs() < 2e-3), "{field} {dz}: {off:?} {direct:?}");
        }
    }
}

#[test]
fn mtf_by_field_is_that_of_each_field() {
    let lens = nominal_triplet();
    let options = AnalysisOptions {
        field_points: 4,
        field_frequencies_per_mm: vec![20.0, 40.0],
        max_frequency_per_mm: Some(40.0),
        frequency_points: 3,
        ..options()
    };
    let by_field = mtf_by_field(&lens, &options).unwrap();
    assert_eq!(by_field.field_deg, lens.fields_deg);
    let waves = by_field.diffraction.unwrap();
    for (i, field) in lens.fields_deg.iter().enumerate() {
        let mtf = field_mtf(&lens, *field, &options).unwrap();
        let direct = mtf.diffraction.unwrap();
        for k in 0..2 {
            assert_eq!(by_field.geometric[k].tangential[i], mtf.geometric.tangential[k + 1]);
            assert_eq!(waves[k].sagittal[i], direct.sagittal[k + 1]);
        }
    }
}

#[test]
fn strehl_and_zernikes_of_defocus_equal_the_formula() {
    // Defocus of W waves at the rim, h^2 / 2 (1 / f - 1 / (f + dz)): Strehl = (sin(pi W) / (pi W))^2; fringe term 4 is W / 2.
    let (f, h) = (400.0, 10.0);
    for waves in [0.0_f64, 0.1, 0.25, 0.5] {
        let mut lens = perfect(20.0);
        lens.surfaces[0].thickness_mm = -1.0 / (1.0 / f - 2.0 * waves * 0.5e-3 / (h * h));
        let found = wavefront(&lens, 0.0).unwrap();
        let wanted = if waves == 0.0 { 1.0 } else { ((PI * waves).sin() / (PI * waves)).powi(2) };
        let strehl = found.strehl[0].unwrap();
        assert!((strehl - wanted).abs() < 2e-3, "{waves}: {strehl} {wanted}");
        let z = found.zernike_waves[0].as_ref().unwrap();
        assert!((z[3].abs() - 0.5 * waves).abs() < 1e-3 * waves.max(0.01), "{waves}: {}", z[3]);
        assert!(z.iter().enumerate().all(|(k, c)| k == 0 || k == 3 || c.abs() < 2e-4));
        assert!((found.peak_to_valley_waves[0] - waves).abs() < 2e-3);
        // RMS of a paraboloid over the disk: W / sqrt(12).
        assert!((found.rms_waves[0] - waves / 12_f64.sqrt()).abs() < 1e-3);
        assert!(found.zernike_residual_waves[0].unwrap() < 1e-5);
    }
}

#[test]
fn the_wavefront_merit_is_the_analysed_wavefront_about_its_best_centre() {
    // Defocus of W waves at the rim has an RMS of W / sqrt(12).
    let (f, h, waves) = (400.0, 10.0, 0.5);
    let mut lens = perfect(20.0);
    lens.surfaces[0].thickness_mm = -1.0 / (1.0 / f - 2.0 * waves * 0.5e-3 / (h * h));
    let rms = RmsWavefront::new(&lens).value(&lens).unwrap();
    assert!((rms / (waves / 12_f64.sqrt()) - 1.0).abs() < 1e-2, "{rms}");
    // Each field of a real lens, at each wavelength alone: the mean and the tilt are removed.
    let lens = nominal_triplet();
    let of_field =
        |lens: &Lens, field: f64| RmsWavefront { fields: FieldSet::new(lens, &[field]) }.value(lens).unwrap();
    for field in [0.0, 5.0, 10.0] {
        let analysed = wavefront(&lens, field).unwrap().rms_centroid_waves;
        let mut squares = 0.0;
        for (um, expected) in lens.wavelengths_um.iter().zip(&analysed) {
            let one = Lens { wavelengths_um: vec![*um], ..lens.clone() };
            let found = of_field(&one, field);
            assert!((found / expected - 1.0).abs() < 0.03, "{field} {um}: {found} {expected}");
            squares += found * found / lens.wavelengths_um.len() as f64;
        }
        // All wavelengths together have one centre: lateral colour is an error of the wavefront, and there is none on the axis.
        let together = of_field(&lens, field) / squares.sqrt();
        let is_expected = if field == 0.0 { (together - 1.0).abs() < 1e-6 } else { together > 1.01 };
        assert!(is_expected, "{field}: {together}");
    }
}

#[test]
fn marechals_strehl_holds_for_small_aberrations() {
    let lens = Lens { entrance_pupil_mm: 1.8, ..nominal_triplet() };
    let lens = petzval_optics::solve::with_paraxial_focus(&lens, 0.0);
    let mut compared = 0;
    for field in [0.0, 5.0] {
        let found = wavefront(&lens, field).unwrap();
        for (rms, strehl) in found.rms_centroid_waves.iter().zip(&found.strehl) {
            if *rms < 0.07 {
                compared += 1;
                let wanted = (-(TAU * rms).powi(2)).exp();
                assert!((strehl.unwrap() - wanted).abs() < 0.01, "{field}: {strehl:?} {wanted}");
            }
        }
    }
    assert!(compared >= 3);
}

#[test]
fn encircled_energy_of_perfect_lenses_is_known() {
    let lens = perfect(8.0);
    let energy = encircled_energy(&lens, 0.0, &AnalysisOptions { radius_points: 201, ..options() }).unwrap();
    let waves = energy.diffraction.unwrap();
    // 1 - J0^2 - J1^2 at v = pi r / (lambda N).
    let sine = (2.0 * (0.25_f64 / 8.0).atan()).sin();
    for (radius, found) in energy.radius_um.iter().zip(&waves).skip(1) {
        let v = TAU / 0.5 * sine * radius;
        let h = 1e-5;
        let j0 = bessel_j1(v) / v + (bessel_j1(v + h) - bessel_j1(v - h)) / (2.0 * h);
        let wanted = 1.0 - j0 * j0 - bessel_j1(v).powi(2);
        assert!((found - wanted).abs() < 3e-3, "{radius}: {found} {wanted}");
    }
    // Rays of a defocused thin lens fill a disk evenly.
    let mut lens = thin(4.0);
    lens.surfaces[0].thickness_mm += 0.8;
    let energy = encircled_energy(&lens, 0.0, &options()).unwrap();
    for (radius, found) in energy.radius_um.iter().zip(&energy.geometric) {
        let wanted = (radius / 100.0).powi(2).min(1.0);
        assert!((found - wanted).abs() < 0.01, "{radius}: {found} {wanted}");
    }
}

#[test]
fn foci_near_the_axis_agree_with_seidel_sums() {
    // Longitudinal: T = -(3 S3 + S4) / (2 n' u'^2), S = -(S3 + S4) / (2 n' u'^2).
    let mut lens = nominal_triplet();
    lens.wavelengths_um = vec![lens.reference_um];
    lens.fields_deg = vec![0.0, 0.3];
    let lens = petzval_optics::solve::with_paraxial_focus(&lens, 0.0);
    let curves = field_curves(&lens, &AnalysisOptions { field_points: 2, ..options() }).unwrap();
    let sums = third_order(&lens).unwrap().total.seidel_mm;
    let slope = 0.5 / first_order(&lens.at_wavelength(lens.reference_um)).f_number;
    let unit = -0.5 / (slope * slope);
    let (t, s) = (curves.tangential_focus_mm[0][1], curves.sagittal_focus_mm[0][1]);
    assert!(curves.tangential_focus_mm[0][0].abs() < 1e-6 && curves.sagittal_focus_mm[0][0].abs() < 1e-6);
    assert!((t / (unit * (3.0 * sums[2] + sums[3])) - 1.0).abs() < 0.01, "{t}");
    assert!((s / (unit * (sums[2] + sums[3])) - 1.0).abs() < 0.01, "{s}");
    // Distortion: S5 / (2 n' u') of the image height.
    let height = curves.distortion_percent[0][1] / 100.0 * first_order_table(&lens).image_height_mm.unwrap();
    assert!((height / (sums[4] / (2.0 * -slope)) - 1.0).abs() < 0.01, "{height} {}", sums[4] / (2.0 * slope));
}

#[test]
fn colours_near_the_axis_agree_with_the_chromatic_sums() {
    // Two close colours: axial -C1 / (n' u'^2), lateral C2 / (n' u').
    let mut lens = nominal_triplet();
    lens.fields_deg = vec![0.0, 1.0];
    lens.reference_um = 0.5876;
    lens.wavelengths_um = vec![0.5874, 0.5878];
    let sums = third_order(&lens).unwrap().total.chromatic_mm;
    let slope = 0.5 / first_order(&lens.at_wavelength(lens.reference_um)).f_number;
    let axial = axial_colour(&lens);
    let (first, last) = (axial.shift_mm[0].unwrap(), axial.shift_mm.last().unwrap().unwrap());
    let wanted = -sums[0] / (slope * slope);
    assert!(((first - last) / wanted - 1.0).abs() < 0.01, "{} {wanted}", first - last);
    let curves = field_curves(&lens, &AnalysisOptions { field_points: 2, ..options() }).unwrap();
    let lateral = 1e-3 * (curves.lateral_colour_um[0][1] - curves.lateral_colour_um[1][1]);
    // The image plane is not at the paraxial focus; to first order in the index chief rays cross it there.
    let wanted = sums[1] / -slope;
    assert!((lateral / wanted - 1.0).abs() < 0.02, "{lateral} {wanted}");
}

#[test]
fn a_thin_lens_in_the_stop_darkens_by_the_fourth_power_of_the_cosine() {
    let mut lens = thin(8.0);
    lens.fields_deg = vec![0.0, 30.0];
    let curves = field_curves(&lens, &options()).unwrap();
    for (field, found) in curves.field_deg.iter().zip(&curves.relative_illumination[0]) {
        assert!((found - field.to_radians().cos().powi(4)).abs() < 1e-6);
    }
    assert!(curves.distortion_percent[0].iter().all(|d| d.abs() < 1e-9));
}

#[test]
fn fans_go_through_the_chief_ray_and_agree_with_their_wavefronts() {
    // Transverse aberration is -R / (n' h) times the slope of the wavefront by the pupil, to the accuracy of a flat sphere.
    let lens = nominal_triplet();
    let found = fan(&lens, 5.0, &AnalysisOptions { fan_points: 201, ..options() }).unwrap();
    let reference = 1; // 0.55 um
    let mid = 100;
    assert_eq!(found.pupil[mid], 0.0);
    for colour in 0..3 {
        assert!(found.tangential_waves[colour][mid].unwrap().abs() < 1e-9);
        assert!(found.sagittal_um[colour][mid].unwrap().abs() < 1e-9);
    }
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let along = lens.image_distance_mm() - order.exit_pupil_at_mm;
    let wave_um = lens.wavelengths_um[reference];
    for k in [60, 80, 120, 140] {
        let w = |i: usize| found.tangential_waves[reference][i].unwrap() * wave_um;
        let slope = (w(k + 1) - w(k - 1)) / (found.pupil[k + 1] - found.pupil[k - 1]);
        let predicted = -along / (0.5 * order.exit_pupil_mm) * slope;
        let ray = found.tangential_um[reference][k].unwrap();
        assert!((predicted - ray).abs() < 0.05 * ray.abs() + 0.5, "{k}: {predicted} {ray}");
    }
}

#[test]
fn spots_are_symmetric_on_the_axis_and_their_radii_those_of_the_beam() {
    let lens = nominal_triplet();
    let axis = spot_diagram(&lens, 0.0, &options()).unwrap();
    assert_eq!(axis.points_um[0].len(), 1 + 6 * (10 * 11) / 2);
    assert!(axis.centroid_um.iter().all(|c| c.abs() < 1e-6));
    let off = spot_diagram(&lens, 10.0, &options()).unwrap();
    // RMS of the points shown, which fill the stop evenly up to their own spacing.
    let all: Vec<[f64; 2]> = off.points_um.iter().flatten().copied().collect();
    let mean = [0, 1].map(|k| all.iter().map(|p| p[k]).sum::<f64>() / all.len() as f64);
    let square: f64 = all.iter().map(|p| (p[0] - mean[0]).powi(2) + (p[1] - mean[1]).powi(2)).sum();
    let rms = (square / all.len() as f64).sqrt();
    assert!((rms / off.rms_um - 1.0).abs() < 0.15, "{rms} {}", off.rms_um);
    assert!(off.geometric_radius_um > off.rms_um);
}

#[test]
fn axial_rays_cross_at_the_paraxial_focus() {
    let lens = nominal_triplet();
    let found = longitudinal_aberration(&lens, &options());
    for (colour, w) in lens.wavelengths_um.iter().enumerate() {
        let focus = first_order(&lens.at_wavelength(*w)).image_distance_mm - lens.image_distance_mm();
        assert!((found.crossing_mm[colour][0].unwrap() - focus).abs() < 1e-6);
    }
}

#[test]
fn the_first_order_table_covers_near_objects_and_front_foci() {
    let mut lens = thin(4.0);
    let table = first_order_table(&lens);
    assert!((table.efl_mm.unwrap() - 80.0).abs() < 1e-9 && (table.ffl_mm.unwrap() + 80.0).abs() < 1e-9);
    // Through a thin lens the marginal ray of tangent 1 / 8 is straight on to the focus.
    let n = 0.5 / 0.125_f64.atan().sin();
    assert!((table.working_f_number.unwrap() - n).abs() < 1e-9 && table.magnification.is_none());
    assert!((table.airy_radius_um.unwrap() - 1.219_67 * 0.5 * n).abs() < 1e-9);
    // One to one: object and image at twice the focal length, working f-number twice as large.
    lens.object = ObjectDistance::Finite(160.0);
    lens.surfaces[0].thickness_mm = 160.0;
    let table = first_order_table(&lens);
    assert!((table.magnification.unwrap() + 1.0).abs() < 1e-12);
    assert!((table.working_f_number.unwrap() - 0.5 / 0.0625_f64.atan().sin()).abs() < 1e-9);
    assert!(table.defocus_mm.unwrap().abs() < 1e-9);
    // A spherical mirror: Petzval radius R / 2, hollow towards the light.
    let table = first_order_table(&perfect(4.0));
    assert!((table.petzval_radius_mm.unwrap() + 80.0).abs() < 1e-9);
}

#[test]
fn a_triplet_has_three_elements_with_edges_of_glass() {
    let lens = nominal_triplet();
    let found = layout(&lens, &options());
    assert_eq!(found.elements.len(), 3);
    for element in &found.elements {
        // The highest points span the edge: as high as the larger semi-diameter, and thick.
        let is_top = |p: &&[f64; 2]| (p[1] - element.height_mm).abs() < 1e-12;
        let top: Vec<f64> = element.outline.iter().filter(is_top).map(|p| p[0]).collect();
        let edge = top.iter().fold(f64::MIN, |a, b| a.max(*b)) - top.iter().fold(f64::MAX, |a, b| a.min(*b));
        assert!(top.len() >= 2 && edge > 0.3, "{edge}");
    }
    assert!((found.elements[0].height_mm - 7.733).abs() < 1e-12);
    assert_eq!(found.elements[1].glass, "N-SF11");
    assert!(found.lines.is_empty());
    // Rays of the axis come symmetrically to the image plane.
    let axis = &found.rays[0];
    let ends: Vec<[f64; 2]> = axis.iter().map(|r| *r.points.last().unwrap()).collect();
    assert!(ends.iter().all(|p| (p[0] - lens.total_track_mm()).abs() < 1e-9));
    for (a, b) in ends.iter().zip(ends.iter().rev()) {
        assert!((a[1] + b[1]).abs() < 1e-9);
    }
}

#[test]
fn cemented_elements_share_their_inner_surface_and_diameter() {
    let mut lens = nominal_triplet();
    // A doublet: the second surface of the first element is cemented to a flint.
    lens.surfaces[1].glass = lens.surfaces[2].glass.clone();
    lens.surfaces[1].thickness_mm = 2.0;
    lens.surfaces.truncate(3);
    lens.surfaces[2].glass = petzval_optics::glass::Glass::air();
    lens.stop = 0;
    lens.fields_deg = vec![0.0];
    lens.surfaces[2].thickness_mm = 20.0;
    let found = layout(&lens, &options());
    let [a, b]: &[LayoutElement; 2] = found.elements.as_slice().try_into().unwrap();
    assert_eq!(a.height_mm, b.height_mm);
    let rear: Vec<_> = a.outline.iter().rev().take(61).collect();
    let front: Vec<_> = b.outline.iter().take(61).collect();
    assert_eq!(rear, front);
}

#[test]
fn a_fold_mirror_turns_the_picture() {
    let mut lens = thin(4.0);
    let placement =
        Placement { tilt_rad: [45_f64.to_radians(), 0.0, 0.0], axis: Axis::Bends, ..Placement::default() };
    lens.surfaces[0].thickness_mm = 50.0;
    lens.surfaces.push(Surface {
        action: Action::Reflect,
        thickness_mm: -30.0,
        semi_diameter_mm: 20.0,
        placement: Some(placement),
        ..Surface::default()
    });
    let found = layout(&lens, &options());
    // Light along +z meets the mirror 50 mm on and leaves at a right angle, 30 mm to the image.
    let end = *found.axis.last().unwrap();
    assert!((end[0] - 50.0).abs() < 1e-9 && (end[1].abs() - 30.0).abs() < 1e-9, "{end:?}");
    for ray in &found.rays[0] {
        let last = *ray.points.last().unwrap();
        assert!(!ray.is_lost && (last[0] - end[0]).hypot(last[1] - end[1]) < 1e-6, "{last:?}");
    }
    assert_eq!(found.lines.len(), 2);
}

#[test]
fn every_lens_is_analysed_whole() {
    let mut all = special_lenses();
    all.extend(built_in::all_lenses().into_iter().map(|file| file.lens));
    for lens in all {
        let coarse = AnalysisOptions { field_points: 3, focus_points: 3, pupil_cells: 32, ..options() };
        let found = analyze(&lens, &coarse, &|| Ok(())).unwrap_or_else(|e| panic!("{}: {e}", lens.name));
        assert_eq!(found.spots.len(), lens.fields_deg.len());
        for mtf in &found.mtf {
            let curves = [Some(&mtf.geometric), mtf.diffraction.as_ref(), mtf.limit.as_ref()];
            for curve in curves.into_iter().flatten() {
                for v in curve.sagittal.iter().chain(&curve.tangential) {
                    assert!((-1e-9..=1.0 + 1e-9).contains(v), "{}: {v}", lens.name);
                }
                assert!((curve.sagittal[0] - 1.0).abs() < 1e-9);
            }
        }
        let text = serde_json::to_string(&found).unwrap();
        assert!(text.len() > 10_000);
    }
}

#[test]
fn wavefronts_have_the_sign_of_seidel_theory() {
    // A slow lens at its paraxial focus: W040 = S1 / 8 at the rim.
    let mut lens = Lens { entrance_pupil_mm: 1.5, ..nominal_triplet() };
    for s in &mut lens.surfaces {
        s.shape.asphere = [0.0; petzval_optics::lens::ASPHERE_TERMS];
    }
    lens.wavelengths_um = vec![lens.reference_um];
    let lens = petzval_optics::solve::with_paraxial_focus(&lens, 0.0);
    let w040 = third_order(&lens).unwrap().wavefront_waves[0];
    let found = fan(&lens, 0.0, &options()).unwrap();
    let rim = found.tangential_waves[0].last().unwrap().unwrap();
    assert!(w040.abs() > 0.01 && (rim / w040 - 1.0).abs() < 0.02, "{rim} {w040}");
}

#[test]
fn a_shifted_image_plane_alone_is_not_distortion() {
    let lens = nominal_triplet();
    let shifted = lens.with_image_distance(lens.image_distance_mm() + 0.5);
    let options = AnalysisOptions { field_points: 4, ..options() };
    for lens in [lens, shifted] {
        let curves = field_curves(&lens, &options).unwrap();
        // Colours between which the reference lies, at the axis: distortion there is lateral colour alone.
        let axis: Vec<f64> = curves.distortion_percent.iter().map(|d| d[0]).collect();
        assert!(axis.iter().all(|d| d.abs() < 0.4) && axis[0] * axis[2] < 0.0, "{axis:?}");
    }
    let mut one = nominal_triplet();
    one.wavelengths_um = vec![one.reference_um];
    let both = Lens { fields_deg: vec![-15.0, 0.0, 15.0], ..one.clone() };
    let found = field_curves(&both, &AnalysisOptions { field_points: 7, ..options.clone() }).unwrap();
    let half = field_curves(&one, &options).unwrap();
    assert_eq!(found.field_deg, [-15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0]);
    for k in 0..4 {
        for there in [found.distortion_percent[0][3 + k], found.distortion_percent[0][3 - k]] {
            assert!((there - half.distortion_percent[0][k]).abs() < 1e-8);
        }
    }
    assert!(half.distortion_percent[0][0].abs() < 1e-6 && half.distortion_percent[0][3] < -1.0);
}

#[test]
fn thin_lenses_have_no_waves() {
    let found = analyze(&thin(4.0), &options(), &|| Ok(())).unwrap();
    assert!(found.mtf[0].diffraction.is_none() && found.encircled_energy[0].diffraction.is_none());
    assert!(found.wavefronts[0].rms_waves[0].is_nan() && found.wavefronts[0].strehl[0].is_none());
    assert!(found.fans[0].tangential_waves[0].iter().all(Option::is_none));
    assert!(found.fans[0].tangential_um[0].iter().all(|v| v.unwrap().abs() < 1e-6));
}

#[test]
fn nothing_is_resolved_beyond_the_cutoff() {
    let lens = perfect(8.0);
    let cutoff = first_order_table(&lens).cutoff_per_mm;
    let options = AnalysisOptions { max_frequency_per_mm: Some(5.0 * cutoff), ..options() };
    let mtf = field_mtf(&lens, 0.0, &options).unwrap();
    let waves = mtf.diffraction.unwrap();
    for (f, m) in mtf.frequency_per_mm.iter().zip(&waves.sagittal).filter(|(f, _)| **f > 1.01 * cutoff) {
        assert!(*m < 1e-3, "{f}: {m}");
    }
}

#[test]
fn foci_are_those_of_close_rays_however_far_away_the_entrance_pupil_is() {
    // The entrance pupil is up to a hundred kilometres away, and larger than the lens by as much; of another colour it lies elsewhere.
    let foci = |beyond_focus_mm: f64| {
        let lens = nearly_telecentric(beyond_focus_mm, vec![0.5, 0.6], 0.5);
        let lens = with_paraxial_focus(&Lens { fields_deg: vec![0.0, 1.0], ..lens }, 0.0);
        let curves = field_curves(&lens, &options()).unwrap();
        assert!(curves.tangential_focus_mm[0][0].abs() < 1e-4, "{beyond_focus_mm}: {curves:?}");
        [&curves.tangential_focus_mm[0], &curves.sagittal_focus_mm[0]].map(|foci_mm| *foci_mm.last().unwrap())
    };
    let far = foci(0.1);
    // The stop moves by a thousandth of its distance, and the foci of the field hardly do.
    for beyond_focus_mm in [1e-2, 1e-4] {
        let near = foci(beyond_focus_mm);
        let moved = (0..2).map(|i| (near[i] - far[i]).abs() / far[i].abs()).fold(0.0, f64::max);
        assert!(far[0] < -1e-3 && moved < 0.05, "{beyond_focus_mm}: {near:?}, {far:?}");
    }
}
