//! Surfaces that are moved and turned.

use petzval_files::parse_seq;
use petzval_optics::lens::{Action, Axis, Lens, Placement};
use petzval_optics::trace::{launch, trace_ray};

use crate::support::{SEQ, catalog, changed, seq, zmx};

/// A lens of planes with these surfaces and coordinate breaks after the first.
fn with_breaks(breaks: &str) -> Lens {
    let text = format!(
        "MODE SEQ\nUNIT MM\nENPD 2\nYFLN 0\nWAVM 1 0.5876 1\nPWAV 1\nSURF 0\n  DISZ INFINITY\nSURF 1\n  STOP\n  DISZ 10\n{breaks}"
    );
    zmx(&text).file.lens
}

#[test]
fn coordinate_breaks_become_placements() {
    let tilt = [20.0_f64, 10.0, 5.0].map(f64::to_radians);
    let lens = with_breaks(
        "SURF 2\n TYPE COORDBRK\n PARM 1 0.1\n PARM 2 0.2\n PARM 3 20\n PARM 4 10\n PARM 5 5\n DISZ 0\nSURF 3\n DISZ 0\n\
         SURF 4\n TYPE COORDBRK\n PARM 1 -0.1\n PARM 2 -0.2\n PARM 3 -20\n PARM 4 -10\n PARM 5 -5\n PARM 6 1\n DISZ 30\nSURF 5\n",
    );
    let placed = Placement { decenter_mm: [0.1, 0.2], tilt_rad: tilt, axis: Axis::Returns };
    assert_eq!((lens.surfaces[1].placement, lens.surfaces[1].thickness_mm), (Some(placed), 30.0));
    // A fold mirror: the second break rotates the axis by the same angle again.
    let lens = with_breaks(
        "SURF 2\n TYPE COORDBRK\n PARM 3 40\n DISZ 0\nSURF 3\n GLAS MIRROR\n DISZ 0\nSURF 4\n TYPE COORDBRK\n PARM 3 40\n DISZ -30\n\
         SURF 5\n",
    );
    let placed = lens.surfaces[1].placement.unwrap();
    assert_eq!((placed.axis, lens.surfaces[1].thickness_mm, lens.surfaces.len()), (Axis::Bends, -30.0, 2));
    let path =
        trace_ray(&lens.at_wavelength(0.5876), launch(&lens.at_wavelength(0.5876), 0.0, [0.0, 0.5]).ray);
    assert!((path.image.unwrap().position[1].abs() - 0.5).abs() < 1e-12, "{:?}", path.image);
    // A break that belongs to no surface becomes planes that only move the axis.
    let lens = with_breaks("SURF 2\n TYPE COORDBRK\n PARM 2 3\n PARM 3 10\n PARM 6 1\n DISZ 7\nSURF 3\n");
    let kinds: Vec<_> = lens.surfaces.iter().map(|s| (s.placement, s.thickness_mm)).collect();
    let turned =
        Placement { tilt_rad: [10_f64.to_radians(), 0.0, 0.0], axis: Axis::Follows, ..Default::default() };
    let shifted = Placement { decenter_mm: [0.0, 3.0], axis: Axis::Follows, ..Default::default() };
    assert_eq!(kinds, [(None, 10.0), (Some(turned), 0.0), (Some(shifted), 7.0)]);
}

#[test]
fn a_break_within_glass_stays_in_it() {
    let lens = with_breaks(
        "SURF 2\n GLAS N-BK7\n DISZ 5\nSURF 3\n TYPE COORDBRK\n PARM 3 10\n DISZ 5\nSURF 4\n GLAS MIRROR\n DISZ -5\nSURF 5\n \
         TYPE COORDBRK\n PARM 3 -3\n DISZ -5\nSURF 6\n DISZ -10\nSURF 7\n",
    );
    let media: Vec<&str> = lens.surfaces.iter().map(|s| s.glass.name.as_str()).collect();
    assert_eq!(media, ["AIR", "N-BK7", "N-BK7", "N-BK7", "N-BK7", "AIR"]);
}

/// A break in reverse order returns the axis, next to a surface or apart from it.
#[test]
fn reverse_breaks_undo_plain_ones() {
    let plain = "SURF 2\n TYPE COORDBRK\n PARM 1 0.3\n PARM 2 -0.2\n PARM 3 12\n PARM 4 -7\n PARM 5 33\n DISZ 0\nSURF 3\n DISZ 0\n";
    let reverse = " TYPE COORDBRK\n PARM 1 -0.3\n PARM 2 0.2\n PARM 3 -12\n PARM 4 7\n PARM 5 -33\n PARM 6 1\n DISZ 20\n";
    let together = with_breaks(&format!("{plain}SURF 4\n{reverse}SURF 5\n"));
    let apart = with_breaks(&format!("{plain}SURF 4\n DISZ 0\nSURF 5\n{reverse}SURF 6\n"));
    assert_eq!((together.surfaces.len(), apart.surfaces.len()), (2, 7));
    for lens in [together, apart] {
        let sequence = lens.at_wavelength(0.5876);
        let image = trace_ray(&sequence, launch(&sequence, 0.1, [0.4, -0.3]).ray).image.unwrap();
        let expected = [0.4, -0.3 + 30.0 * 0.1_f64.tan(), 0.0];
        for axis in 0..3 {
            assert!((image.position[axis] - expected[axis]).abs() < 1e-12, "{image:?}");
        }
    }
}

/// A lens of CODE V with these surfaces after the first.
fn with_surfaces(surfaces: &str) -> Lens {
    let text = format!("RDM;LEN\nEPD 2\nDIM M\nWL 587.6\nYAN 0\nSO 0 1e14\nS 0 10\n STO\n{surfaces}SI 0 0\n");
    seq(&text).file.lens
}

/// Where rays of two fields land, mm; no edge clips them.
fn landings(lens: &Lens) -> Vec<[f64; 3]> {
    let mut lens = lens.clone();
    lens.surfaces.iter_mut().for_each(|surface| surface.semi_diameter_mm = 100.0);
    let sequence = lens.at_wavelength(0.5876);
    let rays = [(0.0, [0.0; 2]), (0.0, [0.7, -0.6]), (0.02, [-0.5, 0.8])];
    let land = |(field, at)| trace_ray(&sequence, launch(&sequence, field, at).ray).image.unwrap().position;
    rays.into_iter().map(land).collect()
}

/// An off-axis parabola behind a break that only shifts the axis. A break of any order puts the axis back, or a part of it, or a dummy of CODE V
/// does: rays parallel to the axis meet in the focus, which stays where the parabola has it.
#[test]
fn shifts_of_the_axis_are_put_back_in_any_order() {
    let parabola = "SURF 2\n TYPE COORDBRK\n PARM 2 -40\n DISZ 0\nSURF 3\n CURV -0.0025\n CONI -1\n GLAS MIRROR\n DISZ 0\n";
    let behind =
        |back: &str| with_breaks(&format!("{parabola}SURF 4\n TYPE COORDBRK\n{back} DISZ -200\nSURF 5\n"));
    let dummy = with_surfaces("S -400 0 REFL\n K -1\n YDE -40\nS 0 -200\n YDE 40\n");
    for (lens, surfaces, focus_mm) in [
        (behind(" PARM 2 40\n"), 2, -40.0),
        (behind(" PARM 2 40\n PARM 6 1\n"), 2, -40.0),
        (behind(" PARM 2 39\n PARM 6 1\n"), 3, -39.0),
        (behind(" PARM 2 39\n"), 3, -39.0),
        (dummy, 3, -40.0),
    ] {
        assert_eq!(lens.surfaces.len(), surfaces);
        for [x, y, z] in &landings(&lens)[..2] {
            let off = [*x, y - focus_mm, *z];
            assert!(off.iter().all(|v| v.abs() < 1e-11), "{focus_mm}: {off:?}");
        }
    }
}

/// Planes that only shift the axis cross no element beside them. A shift behind a rotation by an angle a is a shift by its cosine in front of it,
/// and a distance by its sine.
#[test]
fn planes_that_shift_the_axis_are_no_walls() {
    let broken = |shift: f64, turn: f64, order: u32| {
        format!(" TYPE COORDBRK\n PARM 2 {shift:?}\n PARM 3 {turn:?}\n PARM 6 {order}\n")
    };
    let glass = " GLAS N-BK7 0 0 1.5168 64.17\n";
    let decentred = |order: u32| {
        format!(
            "SURF 2\n{} DISZ 0\nSURF 3\n CURV 0.03\n DISZ 3\n{glass}SURF 4\n CURV 0.015\n DISZ 0\nSURF 5\n{} DISZ 80\nSURF 6\n",
            broken(-1.5, 0.0, order),
            broken(1.5, 0.0, order)
        )
    };
    // A break of the second order, and what it is in the first, in front of the same surfaces.
    let turned = |shift: f64, turn: f64, behind: &str| {
        let (sin, cos) = turn.to_radians().sin_cos();
        let second = format!("SURF 2\n DISZ 0\nSURF 3\n{} DISZ 0\n{behind}", broken(shift, turn, 1));
        let first = format!(
            "SURF 2\n DISZ {:?}\nSURF 3\n{} DISZ 0\n{behind}",
            shift * sin,
            broken(shift * cos, turn, 0)
        );
        [second, first].map(|text| with_breaks(&text))
    };
    let concave = format!("SURF 4\n CURV -0.03\n DISZ 3\n{glass}SURF 5\n CURV -0.05\n DISZ 80\nSURF 6\n");
    let mirror = "SURF 4\n CURV -0.0025\n CONI -1\n GLAS MIRROR\n DISZ -200\nSURF 5\n";
    let (sin, cos) = 5_f64.to_radians().sin_cos();
    let folded = format!(
        "SURF 2\n TYPE COORDBRK\n PARM 3 -20\n DISZ 0\nSURF 3\n GLAS MIRROR\n DISZ 0\nSURF 4\n TYPE COORDBRK\n PARM 3 -20\n DISZ {:?}\n\
         SURF 5\n{} DISZ 0\nSURF 6\n CURV 0.02\n DISZ -5\n{glass}SURF 7\n CURV -0.015\n DISZ -30\nSURF 8\n",
        -10.0 - sin,
        broken(-cos, 5.0, 0)
    );
    let straight = format!("SURF 2\n CURV 0.03\n DISZ 3\n{glass}SURF 3\n CURV 0.015\n DISZ 80\nSURF 4\n");
    let mut twin = with_breaks(&straight);
    for surface in &mut twin.surfaces[1..] {
        surface.placement = Some(Placement { decenter_mm: [0.0, -1.5], ..Placement::default() });
    }
    let stabilised = with_surfaces(
        "S 0 0\n YDE -1.5\nS 33.333333333333336 3 NBK7_SCHOTT\nS 66.66666666666667 0\nS 0 80\n YDE 1.5\n",
    );
    let reversed = with_surfaces(
        "S 0 -10 REFL\n ADE 20; BEN\nS 0 0\n ADE 5; YDE 1; REV\nS 50 -5 NBK7_SCHOTT\nS -66.66666666666667 -30\n",
    );
    for [one, other] in [
        [with_breaks(&decentred(0)), twin.clone()],
        [with_breaks(&decentred(1)), twin.clone()],
        [stabilised, twin],
        turned(1.0, 4.0, &concave),
        turned(-40.0, 2.0, mirror),
        [reversed, with_breaks(&folded)],
    ] {
        for (a, b) in landings(&one).iter().zip(landings(&other)) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-11), "{a:?} {b:?}");
        }
    }
}

#[test]
fn decentred_surfaces_of_code_v() {
    let lens = with_surfaces;
    let placed = |lens: &Lens, i: usize| lens.surfaces[i].placement.unwrap();
    let basic = lens("S 0 30\n XDE 0.1; YDE 0.2; ZDE 1.5\n ADE 20; BDE 10; CDE 5\n");
    // Rotations about x and y are left-handed; a shift along the axis lengthens the distance in front.
    let tilt = [-20.0_f64, -10.0, 5.0].map(f64::to_radians);
    assert_eq!(placed(&basic, 1), Placement { decenter_mm: [0.1, 0.2], tilt_rad: tilt, axis: Axis::Follows });
    assert_eq!((basic.surfaces[0].thickness_mm, basic.surfaces[1].thickness_mm), (11.5, 30.0));
    let back = lens("S 0 30\n ZDE 1.5; ADE 20\n DAR\n");
    assert_eq!((placed(&back, 1).axis, back.surfaces[1].thickness_mm), (Axis::Returns, 28.5));
    let bent = lens("S 0 -30 REFL\n ADE 20\n BEN\n");
    assert_eq!((placed(&bent, 1).axis, bent.surfaces[1].action), (Axis::Bends, Action::Reflect));
    // A reversed decentre behind a surface undoes a plain one.
    let undone = lens(
        "S 0 5\n XDE 0.3; YDE -0.2; ADE 12; BDE -7; CDE 33\nS 0 0\nS 0 20\n XDE 0.3; YDE -0.2; ADE 12; BDE -7; CDE 33\n REV\n",
    );
    let sequence = undone.at_wavelength(0.5876);
    let straight = trace_ray(&sequence, launch(&sequence, 0.0, [0.0; 2]).ray).image.unwrap();
    assert!((straight.direction[2] - 1.0).abs() < 1e-15, "{straight:?}");
    // The image may be rotated.
    let turned = seq(&changed(SEQ, "SI 0 0\n", "SI 0 0\n ADE 5\n")).file.lens;
    assert_eq!(placed(&turned, 2).tilt_rad[0], -(5_f64.to_radians()));
}

/// A mirror turns light by 90 degrees. An image plane that faces this light is edge-on to the mirror's axis.
#[test]
fn an_image_edge_on_to_the_axis_is_refused() {
    let text = |turn: &str| {
        format!(
            "RDM;LEN\nEPD 20\nDIM M\nWL 587.6\nYAN 0\nSO 0 1e14\nS 0 150\n STO\nS -177.8 -88.9 REFL\n K -1\n YDE -177.8\n\
             S 0 0\n YDE 177.8\nS 0 0\n YDE -177.8\n{turn}SI 0 0\n"
        )
    };
    let error = parse_seq(&text(" ADE 90\n"), &catalog()).unwrap_err().to_string();
    assert!(
        error.contains("`ADE 90`") && error.contains("edge-on") && error.contains("another image"),
        "{error}"
    );
}
