//! Streets as a camera sees them: determinism, boxes, projection, light, and what is in them.

use petzval_street::{
    Families, LampColours, LampState, Light, ObjectKind, Projection, Street, StreetError, StreetSettings,
    SurfaceClass, Window,
};

const ROWS: usize = 1200;
const COLUMNS: usize = 1920;
const FOCAL_PX: f64 = 25_000.0 / 5.86;

fn lens(focal_px: f64) -> Projection {
    Projection::rectilinear(focal_px, 1400.0, ROWS, COLUMNS).expect("a valid lens")
}

fn street(sequence: u64, light: Light) -> Street {
    Street::new(&StreetSettings { moment: 2, ..StreetSettings::new(sequence, light) })
}

/// A lens with barrel distortion.
fn barrel() -> Projection {
    let angle: Vec<f64> = (0..300).map(|i| 0.002 * i as f64).collect();
    let radius = angle.iter().map(|a| 2800.0 * (a - 0.15 * a.powi(3))).collect();
    Projection::new(radius, angle, ROWS, COLUMNS).expect("a valid lens")
}

#[test]
fn a_window_shows_the_bits_of_the_whole_picture_on_any_number_of_threads() {
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    for (sequence, light, lens) in [(3, Light::Day, lens(FOCAL_PX)), (4, Light::Night, barrel())] {
        let (street, again) = (street(sequence, light), street(sequence, light));
        let large = Window { row: 470, col: 780, height: 150, width: 210 };
        let whole = street.see(&lens, &street.pose(), large, 2).expect("a valid window");
        let same = single.install(|| again.see(&lens, &again.pose(), large, 2)).expect("a valid window");
        assert_eq!(whole, same);
        let small = Window { row: 511, col: 801, height: 50, width: 61 };
        let cut = street.see(&lens, &street.pose(), small, 2).expect("a valid window");
        for row in 0..small.height {
            let (from, own) = ((row + 41) * large.width + 21, row * small.width);
            assert_eq!(whole.classes[from..from + small.width], cut.classes[own..own + small.width]);
        }
        for channel in 0..3 {
            for row in 0..small.height {
                let from = (channel * large.height + row + 41) * large.width + 21;
                let own = (channel * small.height + row) * small.width;
                let (a, b) = (&whole.planes[from..from + small.width], &cut.planes[own..own + small.width]);
                assert!(
                    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()),
                    "channel {channel}, row {row}"
                );
            }
        }
    }
}

#[test]
fn the_box_of_an_object_that_nothing_hides_is_the_extent_of_its_samples() {
    let mut counts = [0; 3];
    for sequence in 0..16 {
        let lens = if sequence % 2 == 0 { lens(FOCAL_PX) } else { barrel() };
        let street = street(sequence, Light::Day);
        for object in street.objects_near(&lens, &street.pose()).expect("a valid pose") {
            let [x1, y1, x2, y2] = object.whole;
            // Of each sequence, the objects of moderate size inside the sensor.
            let inside = x1 > 4.0 && y1 > 4.0 && x2 < COLUMNS as f64 - 4.0 && y2 < ROWS as f64 - 4.0;
            let size = (x2 - x1).max(y2 - y1);
            if !inside || !(16.0..240.0).contains(&size) {
                continue;
            }
            let window = Window {
                row: y1 as i64 - 2,
                col: x1 as i64 - 2,
                height: (y2 - y1) as usize + 6,
                width: (x2 - x1) as usize + 6,
            };
            // A coarse look first: most objects are partly hidden.
            let see = |samples| street.see(&lens, &street.pose(), window, samples).expect("a valid window");
            if !see(1).objects.iter().any(|o| o.id == object.id && o.visible_share == 1.0) {
                continue;
            }
            let seen = see(3);
            let Some(own) = seen.objects.iter().find(|o| o.id == object.id) else { continue };
            assert_eq!(own.whole, object.whole);
            assert!((own.inside_share - 1.0).abs() < 1e-9);
            if own.visible_share < 1.0 {
                continue;
            }
            let visible = own.visible.expect("a visible object has a box");
            for (a, b) in own.whole.into_iter().zip(visible) {
                assert!(
                    (a - b).abs() <= 1.0,
                    "street {sequence}: {:?} {:?} {visible:?}",
                    own.kind,
                    own.whole
                );
            }
            match own.kind {
                ObjectKind::Pedestrian => counts[0] += 1,
                ObjectKind::Vehicle => counts[1] += 1,
                _ => counts[2] += 1,
            }
        }
    }
    assert!(counts.iter().all(|count| *count >= 10), "too few objects to judge: {counts:?}");
}

#[test]
fn every_pixel_has_the_class_of_what_it_shows() {
    // The whole sensor on few pixels.
    let (rows, columns) = (150, 240);
    let lens = Projection::rectilinear(FOCAL_PX / 16.0, 200.0, rows, columns).expect("a valid lens");
    let window = Window { row: 0, col: 0, height: rows, width: columns };
    let mut pixels = [0_usize; SurfaceClass::ALL.len()];
    let (mut objects, mut shown) = (0, 0);
    for sequence in 0..24 {
        let street = street(sequence, Light::Day);
        let seen = street.see(&lens, &street.pose(), window, 2).expect("a valid window");
        let at = |row: usize, column: usize| seen.classes[row * columns + column];
        seen.classes.iter().for_each(|class| pixels[*class as usize] += 1);
        // The camera stands on the road, and looks at nothing but it right below the middle, or at what stands on it.
        let below = at(rows - 1, columns / 2);
        assert!(matches!(below, SurfaceClass::Road | SurfaceClass::Vehicle | SurfaceClass::Pedestrian));
        for (kind, class) in [
            (ObjectKind::Vehicle, SurfaceClass::Vehicle),
            (ObjectKind::Pedestrian, SurfaceClass::Pedestrian),
            (ObjectKind::TrafficLight, SurfaceClass::Signal),
        ] {
            let boxes: Vec<[f64; 4]> =
                seen.objects.iter().filter(|o| o.kind == kind).filter_map(|o| o.visible).collect();
            // Nothing is a vehicle or a person outside the boxes of those; a signal may be a board, or of another kind.
            if kind != ObjectKind::TrafficLight {
                for (i, found) in seen.classes.iter().enumerate().filter(|(_, found)| **found == class) {
                    let (x, y) = ((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5);
                    let inside = |[x1, y1, x2, y2]: &[f64; 4]| {
                        (x1 - 1.0..x2 + 1.0).contains(&x) && (y1 - 1.0..y2 + 1.0).contains(&y)
                    };
                    assert!(boxes.iter().any(inside), "{found:?} at {x} {y} of street {sequence}");
                }
            }
            // A large object that nothing hides is the class of some pixel in its box.
            let whole = seen.objects.iter().filter(|o| o.kind == kind && o.visible_share > 0.9);
            for [x1, y1, x2, y2] in whole.filter_map(|o| o.visible) {
                if x2 - x1 >= 4.0 && y2 - y1 >= 4.0 {
                    objects += 1;
                    let (columns, rows) = (x1 as usize..x2.ceil() as usize, y1 as usize..y2.ceil() as usize);
                    shown += usize::from(
                        rows.clone().any(|row| columns.clone().any(|column| at(row, column) == class)),
                    );
                }
            }
        }
    }
    assert!(objects > 20 && shown == objects, "{shown} of {objects}");
    let missing: Vec<_> = SurfaceClass::ALL.iter().zip(&pixels).filter(|(_, count)| **count == 0).collect();
    assert!(missing.is_empty(), "{missing:?}");
    // What fills most of a street.
    let share = |class: SurfaceClass| pixels[class as usize] as f64 / pixels.iter().sum::<usize>() as f64;
    for class in [SurfaceClass::Road, SurfaceClass::Building, SurfaceClass::Sky] {
        assert!(share(class) > 0.05, "{class:?}: {}", share(class));
    }
}

#[test]
fn hidden_samples_lower_the_visible_share() {
    let (mut partly, mut hidden) = (0, 0);
    for sequence in 0..4 {
        let street = street(sequence, Light::Day);
        let window = Window { row: 380, col: 500, height: 300, width: 900 };
        let seen = street.see(&lens(FOCAL_PX), &street.pose(), window, 1).expect("a valid window");
        for object in &seen.objects {
            assert!(
                (0.0..=1.0).contains(&object.visible_share) && (0.0..=1.0).contains(&object.inside_share)
            );
            assert_eq!(object.visible.is_some(), object.visible_share > 0.0);
            if let Some(visible) = object.visible {
                let [x1, y1, x2, y2] = object.whole;
                assert!(visible[0] >= x1 - 1.0 && visible[1] >= y1 - 1.0, "{object:?}");
                assert!(visible[2] <= x2 + 1.0 && visible[3] <= y2 + 1.0, "{object:?}");
            }
            partly += usize::from(object.visible_share > 0.1 && object.visible_share < 0.9);
            hidden += usize::from(object.visible_share == 0.0);
        }
    }
    assert!(partly >= 5 && hidden >= 5, "{partly} partly hidden, {hidden} hidden");
}

#[test]
fn twice_the_focal_length_doubles_every_box() {
    let street = street(5, Light::Day);
    let pose = street.pose();
    let near = |focal: f64| street.objects_near(&lens(focal), &pose).expect("a valid pose");
    let (short, long) = (near(1500.0), near(3000.0));
    assert!(short.len() > long.len() && long.len() > 3, "{} {}", short.len(), long.len());
    // Beyond the corner of the sensor the table of the lens ends.
    let inside = |whole: [f64; 4]| {
        whole[0] > 0.0 && whole[1] > 0.0 && whole[2] < COLUMNS as f64 && whole[3] < ROWS as f64
    };
    assert!(long.iter().filter(|object| inside(object.whole)).count() >= 3);
    for object in long.iter().filter(|object| inside(object.whole)) {
        let other = short.iter().find(|o| o.id == object.id).expect("a shorter lens sees all of it");
        for i in 0..2 {
            let ratio = (object.whole[i + 2] - object.whole[i]) / (other.whole[i + 2] - other.whole[i]);
            assert!((ratio - 2.0).abs() < 1e-3, "{ratio}");
        }
    }
}

/// Luminance (middle channel) of small windows all over the sensor, sorted.
fn luminances(sequences: std::ops::Range<u64>, light: Light) -> Vec<f32> {
    let mut all = Vec::new();
    for sequence in sequences {
        let street = street(sequence, light);
        for row in (0..ROWS as i64).step_by(60) {
            let window = Window { row, col: 0, height: 1, width: COLUMNS };
            let seen = street.see(&lens(FOCAL_PX), &street.pose(), window, 1).expect("a valid window");
            assert!(seen.planes.iter().all(|l| l.is_finite() && *l >= 0.0), "{light:?} {sequence}");
            all.extend(seen.planes[COLUMNS..2 * COLUMNS].iter().copied());
        }
    }
    all.sort_by(f32::total_cmp);
    all
}

#[test]
fn the_light_of_day_dusk_and_night_lies_in_its_range() {
    for (light, median, least, most) in [
        (Light::Day, 1_000.0..8_000.0, 20.0, 30_000.0),
        (Light::Dusk, 0.5..12.0, 0.01, 300.0),
        (Light::Night, 0.02..1.0, 0.001, 40.0),
    ] {
        let all = luminances(0..12, light);
        let at = |share: f64| all[(share * (all.len() - 1) as f64) as usize];
        assert!(median.contains(&at(0.5)), "{light:?}: median {}", at(0.5));
        assert!(at(0.01) > least && at(0.99) < most, "{light:?}: {} to {}", at(0.01), at(0.99));
    }
}

#[test]
fn a_lamp_shows_its_colour_and_luminance_and_an_unlit_one_is_dark() {
    let colours = LampColours { red: [3.0, 0.0, 0.5], yellow: [2.0, 1.0, 0.0], green: [0.0, 2.0, 0.25] };
    let mut counts = [0; 4];
    for sequence in 0..60 {
        let settings =
            StreetSettings { lamp_colours: colours, ..StreetSettings::new(sequence, Light::Night) };
        let street = Street::new(&settings);
        for object in street.objects_near(&lens(FOCAL_PX), &street.pose()).expect("a valid pose") {
            let [x1, y1, x2, y2] = object.whole;
            if object.kind != ObjectKind::TrafficLight || y2 - y1 < 40.0 || y1 < 0.0 {
                continue;
            }
            let window = Window {
                row: y1 as i64,
                col: x1 as i64,
                height: (y2 - y1) as usize,
                width: (x2 - x1) as usize,
            };
            let seen = street.see(&lens(FOCAL_PX), &street.pose(), window, 2).expect("a valid window");
            let own = seen.objects.iter().find(|o| o.id == object.id).expect("the light is in the window");
            if own.visible_share < 1.0 {
                continue;
            }
            let area = seen.height * seen.width;
            let brightest = (0..area)
                .map(|i| [seen.planes[i], seen.planes[area + i], seen.planes[2 * area + i]])
                .max_by(|a, b| a.iter().sum::<f32>().total_cmp(&b.iter().sum()))
                .expect("the window has pixels");
            let state = own.lamp.expect("a traffic light has a state");
            counts[state as usize] += 1;
            let colour = match state {
                LampState::Red => colours.red,
                LampState::Yellow => colours.yellow,
                LampState::Green => colours.green,
                LampState::Off => {
                    assert!(brightest.iter().all(|channel| *channel < 60.0), "{brightest:?}");
                    continue;
                }
            };
            let luminance = brightest[0].max(brightest[1]) / colour[0].max(colour[1]);
            assert!((2_000.0..20_000.0).contains(&luminance), "{state:?}: {luminance} cd/m^2");
            for channel in 0..3 {
                let expected = colour[channel] * luminance;
                assert!((brightest[channel] - expected).abs() < 0.02 * luminance, "{state:?} {brightest:?}");
            }
        }
    }
    assert!(
        counts[..3].iter().all(|count| *count >= 3) && counts[3] >= 1,
        "too few lamps to judge: {counts:?}"
    );
}

#[test]
fn the_two_halves_of_the_families_share_none_and_make_up_all() {
    let used = |families: Families| {
        let mut all = std::collections::BTreeSet::new();
        for sequence in 0..30 {
            let settings = StreetSettings { families, ..StreetSettings::new(sequence, Light::Day) };
            all.extend(Street::new(&settings).families().iter().cloned());
        }
        all
    };
    let (first, second, all) = (used(Families::First), used(Families::Second), used(Families::All));
    assert!(first.is_disjoint(&second));
    assert_eq!(first.union(&second).cloned().collect::<std::collections::BTreeSet<_>>(), all);
    for group in
        ["car/", "truck/", "person/", "hood/", "tree/", "thing/", "texture/", "wall/", "windows/", "mast/"]
    {
        for half in [&first, &second] {
            assert!(half.iter().filter(|name| name.starts_with(group)).count() >= 2, "{group}");
        }
    }
}

#[test]
fn two_hundred_streets_hold_what_detectors_look_for() {
    let lens = lens(FOCAL_PX);
    let centre = [0.5 * COLUMNS as f64, 0.5 * ROWS as f64];
    let (mut with, mut total, mut large) = ([0; 3], [0; 3], 0);
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0f64);
    let (mut upper, mut central) = (0, 0);
    for sequence in 0..200 {
        let street = street(sequence, Light::Day);
        let mut here = [0; 3];
        for object in street.objects_near(&lens, &street.pose()).expect("a valid pose") {
            let [x1, y1, x2, y2] = object.whole;
            let task = match object.kind {
                ObjectKind::Pedestrian => 0,
                ObjectKind::Vehicle => 1,
                ObjectKind::TrafficLight => 2,
                _ => continue,
            };
            here[task] += 1;
            large += usize::from((x2 - x1).max(y2 - y1) > 12.0);
            (nearest, farthest) = (nearest.min(object.distance_m), farthest.max(object.distance_m));
            if task == 2 {
                let [x, y] = [0.5 * (x1 + x2), 0.5 * (y1 + y2)];
                upper += usize::from(y < centre[1]);
                central += usize::from((x - centre[0]).abs() < 0.25 * COLUMNS as f64);
            }
        }
        for task in 0..3 {
            with[task] += usize::from(here[task] > 0);
            total[task] += here[task];
        }
    }
    println!("streets with people, vehicles, lights: {with:?} of 200; {total:?} in all; {large} above 12 px");
    println!(
        "{nearest} to {farthest} m; of the lights {upper} in the upper half, {central} in the middle half"
    );
    assert!(with[0] >= 190 && with[1] >= 190 && with[2] >= 150, "{with:?}");
    assert!(nearest < 5.0 && farthest > 200.0, "{nearest} {farthest}");
    assert!(
        upper as f64 > 0.85 * total[2] as f64 && central as f64 > 0.6 * total[2] as f64,
        "{upper} {central}"
    );
    assert!(large >= 200 * 12, "{large}");
}

#[test]
fn people_walk_and_the_camera_drives_from_moment_to_moment() {
    let at = |moment: u32| Street::new(&StreetSettings { moment, ..StreetSettings::new(11, Light::Day) });
    let lens = lens(1500.0);
    let (first, later) = (at(0), at(3));
    assert!(later.pose().position_m[2] >= first.pose().position_m[2]);
    let people = |street: &Street| {
        let near = street.objects_near(&lens, &street.pose()).expect("a valid pose");
        near.into_iter().filter(|o| o.kind == ObjectKind::Pedestrian).collect::<Vec<_>>()
    };
    let (before, after) = (people(&first), people(&later));
    let moved = before.iter().filter(|a| after.iter().any(|b| a.id == b.id && a.whole != b.whole)).count();
    assert!(moved >= 3, "{moved} of {} people moved", before.len());
    assert_eq!(people(&at(3)), after);
}

#[test]
fn a_less_busy_street_has_fewer_cars_and_people() {
    let lens = lens(FOCAL_PX);
    let count = |busy: f64, kind: ObjectKind| {
        let of_street = |sequence| {
            let street = Street::new(&StreetSettings { busy, ..StreetSettings::new(sequence, Light::Day) });
            let near = street.objects_near(&lens, &street.pose()).expect("a valid pose");
            near.iter().filter(|o| o.kind == kind).count()
        };
        (0..20).map(of_street).sum::<usize>()
    };
    for kind in [ObjectKind::Pedestrian, ObjectKind::Vehicle] {
        let [none, some, all] = [0.0, 0.4, 1.0].map(|busy| count(busy, kind));
        assert!(none < some / 2 && 3 * some < 2 * all, "{kind:?}: {none}, {some}, {all}");
    }
    // Cars on streets that cross stay; nobody walks in an empty street.
    assert_eq!(count(0.0, ObjectKind::Pedestrian), 0);
}

#[test]
fn wrong_windows_and_samples_are_refused() {
    let street = street(1, Light::Day);
    let see = |height, width, row, samples| {
        street.see(&lens(FOCAL_PX), &street.pose(), Window { row, col: 0, height, width }, samples)
    };
    assert!(matches!(see(0, 5, 0, 2), Err(StreetError::Window { height: 0, width: 5 })));
    assert!(matches!(see(5, 0, 0, 2), Err(StreetError::Window { .. })));
    assert!(matches!(see(usize::MAX, 5, 0, 2), Err(StreetError::Window { .. })));
    assert!(matches!(see(5, 5, i64::MAX, 2), Err(StreetError::FarWindow { .. })));
    assert!(matches!(see(5, 5, 0, 0), Err(StreetError::Samples { samples: 0 })));
    let mut pose = street.pose();
    pose.yaw_rad = f64::NAN;
    let window = Window { row: 0, col: 0, height: 2, width: 2 };
    assert!(matches!(
        street.see(&lens(FOCAL_PX), &pose, window, 1),
        Err(StreetError::Pose { name: "yaw", .. })
    ));
    // A window beyond the sensor is valid: it is a border.
    assert!(see(5, 5, -40, 2).is_ok());
}
