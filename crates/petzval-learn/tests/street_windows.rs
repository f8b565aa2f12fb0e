//! Windows of generated streets: what they depend on, and what is to be found in them.

use petzval_base::statistics::median;
use petzval_learn::dataset::{Classes, CropPlan, LabelledWindow, List, StreetPlan, StreetView};
use petzval_learn::detection::{BBox, Object};
use petzval_street::{Families, Light};

/// Side of a window behind the lens in whose view places are chosen, pixels.
const CROP: usize = 192;

/// Focal length of that lens.
const REFERENCE_MM: f64 = 25.0;

fn view(efl_mm: f64) -> StreetView {
    let radius_px: Vec<f64> = (0..160).map(|i| 8.0 * f64::from(i)).collect();
    let angle_rad: Vec<f64> = radius_px.iter().map(|r| (r * 5.86e-3 / efl_mm).atan()).collect();
    StreetView::new(&radius_px, &angle_rad, [1200, 1920]).unwrap().with_scale(efl_mm / REFERENCE_MM)
}

/// Side of a window behind a lens, pixels.
fn crop_of(efl_mm: f64) -> usize {
    CropPlan::on_1920x1200(CROP, 0).scaled(efl_mm / REFERENCE_MM).crop
}

fn plan() -> StreetPlan {
    StreetPlan {
        seed: 1,
        light: Light::Day,
        busy: 0.4,
        classes: Classes::parse(include_str!("../../petzval-data/data/tasks/pedestrian-vehicle.toml"))
            .unwrap(),
        surfaces: None,
        white_cd_m2: 3.0,
        samples: 1,
        on_objects: 1.0,
        least_side_px: 24.0,
        least_visible: 0.6,
    }
}

fn window(plan: &StreetPlan, list: List, number: u64, view: &StreetView) -> LabelledWindow {
    let crops = CropPlan::on_1920x1200(CROP, 0);
    plan.window(list, Families::All, number, [view, &self::view(REFERENCE_MM)], &crops).unwrap()
}

#[test]
fn a_window_depends_on_its_number_and_its_list_alone() {
    let (plan, view) = (plan(), view(25.0));
    let first = window(&plan, List::Training, 3, &view);
    assert_eq!(first, window(&plan, List::Training, 3, &view));
    for other in [
        window(&plan, List::Training, 4, &view),
        window(&plan, List::Validation, 3, &view),
        window(&plan, List::HeldOut, 3, &view),
        window(&StreetPlan { seed: 2, ..plan.clone() }, List::Training, 3, &view),
    ] {
        assert_ne!(first.scene(), other.scene());
    }
}

#[test]
fn windows_on_objects_hold_objects_that_count() {
    let (plan, view) = (plan(), view(25.0));
    let windows: Vec<LabelledWindow> = (0..24).map(|i| window(&plan, List::Training, i, &view)).collect();
    let with = windows.iter().filter(|w| !w.truth.objects.is_empty()).count();
    // The finder is coarse, and a street may be empty.
    assert!(with >= 18, "{with} of 24 windows have something to find");
    let classes = |class| windows.iter().filter(|w| w.truth.objects.iter().any(|o| o.class == class)).count();
    assert!(classes(0) >= 5 && classes(1) >= 5, "{} with people, {} with vehicles", classes(0), classes(1));
    for object in windows.iter().flat_map(|w| &w.truth.objects) {
        let b = &object.bbox;
        assert!(b.x1 >= 0.0 && b.y1 >= 0.0 && b.x2 <= CROP as f32 && b.y2 <= CROP as f32, "{b:?}");
        assert!(b.is_at_least(1.0));
    }
}

/// A shorter lens shows the same part of the street on fewer pixels: the same objects, smaller.
#[test]
fn another_lens_looks_at_the_same_part_of_the_street() {
    let plan = plan();
    let (scale, mut compared, mut at_edges) = (18.0 / 25.0, 0, 0);
    for number in 0..24 {
        let list = [List::HeldOut, List::Training, List::Validation][number as usize / 2 % 3];
        let plan = StreetPlan { on_objects: (number % 2) as f64, ..plan.clone() };
        let [long, short] = [25.0, 18.0].map(|efl| window(&plan, list, number, &view(efl)));
        // Those that were moved inside the sensor of the longer lens too.
        at_edges += usize::from((0..2).any(|i| long.at[i] == 0 || long.at[i] == [1200, 1920][i] - CROP));
        for i in 0..2 {
            let middle = |w: &LabelledWindow, side: f64| w.at[i] as f64 + 0.5 * side - [600.0, 960.0][i];
            let (long, short) = (middle(&long, CROP as f64), middle(&short, crop_of(18.0) as f64));
            assert!((short - scale * long).abs() < 2.0, "{number}: {short} {long}");
        }
        // What an edge cuts off is not cut at the same pixel.
        let is_whole = |o: &&Object| {
            let BBox { x1, y1, x2, y2 } = o.bbox;
            x1.min(y1) > 1.0 && x2.max(y2) < CROP as f32 - 1.0
        };
        for object in long.truth.objects.iter().filter(is_whole) {
            let [x1, y1, x2, y2] = [object.bbox.x1, object.bbox.y1, object.bbox.x2, object.bbox.y2]
                .map(|edge| edge * scale as f32);
            let there = BBox::new(x1, y1, x2, y2);
            let is_it = |o: &&Object| o.class == object.class && o.bbox.iou(&there) > 0.75;
            assert!(
                short.truth.objects.iter().any(|o| is_it(&o)),
                "{number}: {object:?} in {:?}",
                short.truth
            );
            compared += 1;
        }
    }
    assert!(compared > 5 && at_edges > 2, "{compared} objects, {at_edges} windows at the edges");
}

/// A brighter lens makes the picture of a dark street brighter; by day the automatic exposure takes that back.
#[test]
fn light_shows_where_the_exposure_is_at_its_longest() {
    for (light, shows) in [(Light::Day, false), (Light::Night, true)] {
        let plan = StreetPlan { light, ..plan() };
        let [own, bright] =
            [1.0, 2.0].map(|light| window(&plan, List::HeldOut, 1, &view(25.0).with_light(light)));
        assert_eq!([own.follows_light, bright.follows_light], [shows; 2]);
        // Lamps are brighter than what is kept.
        let middle = |w: &LabelledWindow| median(w.scene().data.iter().map(|v| f64::from(*v)));
        let ratio = middle(&bright) / middle(&own);
        assert!((ratio - if shows { 2.0 } else { 1.0 }).abs() < 1e-2, "{light:?}: {ratio}");
    }
}

/// A longer lens makes more objects large enough to see and fewer visible. It is judged by the same objects, also by those outside its
/// field.
#[test]
fn a_longer_lens_is_judged_by_the_same_objects() {
    let plan = StreetPlan { on_objects: 1.0, ..plan() };
    let mut beside = 0;
    for number in 0..40 {
        let [own, long] = [25.0, 50.0].map(|efl| window(&plan, List::HeldOut, number, &view(efl)));
        assert!(own.truth.beside.is_empty());
        // In training, objects outside the field do not count.
        assert!(window(&plan, List::Training, number, &view(50.0)).truth.beside.is_empty());
        let side = crop_of(50.0);
        assert_eq!(side, 2 * CROP);
        let crop = side as f32;
        for Object { bbox, class } in &long.truth.beside {
            beside += 1;
            assert!(
                own.truth.objects.iter().any(|o| o.class == *class),
                "{number}: it counts in the other view"
            );
            // The window is as near to it as the sensor allows, and shows little of it.
            let shown = bbox.clipped([side; 2]);
            assert!(shown.area() < 0.4 * bbox.area(), "{number}: {bbox:?}");
            let is_left_or_up = [bbox.x1 < 0.0, bbox.y1 < 0.0];
            let is_right_or_down = [bbox.x2 > crop, bbox.y2 > crop];
            let [rows, columns] = [1200, 1920];
            let at_edge = |axis: usize, i: usize, sensor: usize| {
                (is_left_or_up[axis] && long.at[i] == 0)
                    || (is_right_or_down[axis] && long.at[i] == sensor - side)
            };
            assert!(at_edge(0, 1, columns) || at_edge(1, 0, rows), "{number}: {bbox:?} at {:?}", long.at);
        }
        // One that counts is twice as large as through the lens in whose view it counts, unless it is cut off.
        let longer_side = |b: &BBox| b.width().max(b.height());
        for bbox in long.truth.objects.iter().map(|o| o.bbox) {
            let is_cut = bbox.x1 <= 0.0 || bbox.y1 <= 0.0 || bbox.x2 >= crop || bbox.y2 >= crop;
            assert!(is_cut || longer_side(&bbox) >= 1.8 * 24.0, "{number}: {bbox:?}");
        }
    }
    assert!(beside > 0, "the longer lens sees every object");
}

#[test]
fn a_mirror_swaps_left_and_right() {
    let (plan, view) = (plan(), view(25.0));
    let window = (0..).map(|i| window(&plan, List::Training, i, &view)).find(|w| !w.truth.objects.is_empty());
    let window = window.unwrap();
    let mirrored = window.mirrored(CROP, 1920);
    assert_ne!(mirrored, window);
    let (before, after) = (window.truth.objects[0].bbox, mirrored.truth.objects[0].bbox);
    assert_eq!([after.x1, after.x2], [CROP as f32 - before.x2, CROP as f32 - before.x1]);
    assert_eq!([after.y1, after.y2], [before.y1, before.y2]);
    assert_eq!(mirrored.at[1] + CROP + window.at[1], 1920);
    let (a, b) = (window.scene(), mirrored.scene());
    assert_eq!(a.data[..CROP].iter().rev().copied().collect::<Vec<_>>(), b.data[..CROP]);
    assert_eq!(mirrored.mirrored(CROP, 1920).scene(), a);
}
