//! Compares average precision with pycocotools and with the definition of Pascal VOC, and checks bootstrap, groups and states.

use petzval_files::coco::{self, LIGHT_STATES, light_state};
use petzval_learn::score::detection::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

/// The data and figures of `fixtures/detection_scores.json`; `fixtures/README.md` says where they come from.
fn fixture() -> (Value, Vec<Picture>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/detection_scores.json");
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut pictures = vec![Picture::default(); file["gt"]["images"].as_array().unwrap().len()];
    let bounds = |value: &Value| -> Xywh { std::array::from_fn(|i| value["bbox"][i].as_f64().unwrap()) };
    let place = |value: &Value, key: &str| value[key].as_u64().unwrap() as usize - 1;
    for a in file["gt"]["annotations"].as_array().unwrap() {
        pictures[place(a, "image_id")].objects.push(TrueObject {
            class: place(a, "category_id"),
            bounds: bounds(a),
            area: a["area"].as_f64().unwrap(),
            crowd: a["iscrowd"] == 1,
            // pycocotools marks crowds as ignored.
            ignore: a["ignore"] == 1,
        });
    }
    for d in file["detections"].as_array().unwrap() {
        pictures[place(d, "image_id")].detections.push(FoundObject {
            class: place(d, "category_id"),
            bounds: bounds(d),
            score: d["score"].as_f64().unwrap(),
        });
    }
    (file, pictures)
}

fn near(found: Option<f64>, wanted: &Value, name: &str) {
    let (found, wanted) = (found.unwrap_or(-1.0), wanted.as_f64().unwrap());
    assert!((found - wanted).abs() < 1e-12, "{name}: {found}, reference {wanted}");
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn coco_figures_are_those_of_pycocotools() {
    let (file, pictures) = fixture();
    let found = coco_summary(&pictures, 3);
    for (value, name) in [
        (found.ap, "AP"),
        (found.ap50, "AP50"),
        (found.ap75, "AP75"),
        (found.ap_small, "AP_small"),
        (found.ap_medium, "AP_medium"),
        (found.ap_large, "AP_large"),
        (found.ar1, "AR1"),
        (found.ar10, "AR10"),
        (found.ar100, "AR100"),
        (found.ar_small, "AR_small"),
        (found.ar_medium, "AR_medium"),
        (found.ar_large, "AR_large"),
    ] {
        near(value, &file["stats"][name], name);
    }
    for (class, name) in ["pedestrian", "vehicle", "traffic_light"].into_iter().enumerate() {
        near(found.class_ap[class], &file["per_category_AP"][name], name);
    }

    let ranking = Ranking::new(&pictures, 3, &Protocol::coco(), &Group::all());
    let curve = ranking.classes[0].curve(0, None).unwrap();
    let (precision, scores) =
        (numbers(&file["precision_iou50_class0_101pt"]), numbers(&file["scores_iou50_class0"]));
    for i in 0..=100 {
        let (p, s) = curve.at(i as f64 * 0.01);
        assert!((p - precision[i]).abs() < 1e-12 && s == scores[i], "{i}: {p} {s}");
    }
    for (t, row) in file["recall"].as_array().unwrap().iter().enumerate() {
        for (class, wanted) in numbers(row).into_iter().enumerate() {
            let found = ranking.classes[class].recall(t, 100).unwrap();
            assert!((found - wanted).abs() < 1e-12, "{t} {class}: {found}, reference {wanted}");
        }
    }
}

#[test]
fn a_data_set_gives_the_same_pictures() {
    let (file, pictures) = fixture();
    let mut defects = coco::Defects::default();
    let mut gt = file["gt"].clone();
    for (i, image) in gt["images"].as_array_mut().unwrap().iter_mut().enumerate() {
        image["file_name"] = format!("{i}.png").into();
        // Pictures 3 and 5 are of one film.
        if i == 3 || i == 5 {
            image["sequence"] = "film".into();
        }
    }
    let mut data = coco::parse_coco(gt.to_string().into_bytes(), &mut defects).unwrap();
    let detection = |record: &Value| coco::Detection {
        image_id: record["image_id"].as_u64().unwrap(),
        category_id: record["category_id"].as_u64().unwrap(),
        bounds: serde_json::from_value::<[f64; 4]>(record["bbox"].clone()).unwrap().into(),
        score: record["score"].as_f64().unwrap(),
    };
    let found: Vec<_> = file["detections"].as_array().unwrap().iter().map(detection).collect();
    assert_eq!(defects.errors(), 0);
    data.images.reverse();
    data.categories.reverse();
    let (of_data_set, names) = pictures_of_data_set(&data, &found);
    assert_eq!(names, ["pedestrian", "vehicle", "traffic_light"]);
    assert_eq!(of_data_set, pictures);
    assert_eq!(clusters_of_data_set(&data), [0, 1, 2, 3, 4, 3, 5, 6]);
}

#[test]
fn voc_figures_follow_the_definition() {
    let (file, mut pictures) = fixture();
    // The difficult objects of the reference are its crowds, which VOC does not have.
    for object in pictures.iter_mut().flat_map(|picture| &mut picture.objects) {
        (object.ignore, object.crowd) = (object.crowd, false);
    }
    for (interpolation, name) in
        [(Interpolation::AllPoints, "AP_all_points_iou50"), (Interpolation::Points11, "AP_11pt_iou50")]
    {
        let found = voc_average_precision(&pictures, 3, interpolation);
        for (class, of) in ["pedestrian", "vehicle", "traffic_light"].into_iter().enumerate() {
            near(found[class], &file["voc"][name][of], of);
        }
    }
}

fn object(class: usize, bounds: Xywh) -> TrueObject {
    TrueObject { class, bounds, area: bounds[2] * bounds[3], crowd: false, ignore: false }
}

fn found(class: usize, bounds: Xywh, score: f64) -> FoundObject {
    FoundObject { class, bounds, score }
}

#[test]
fn an_overlap_at_the_threshold_counts() {
    // Overlaps of 9/10 and 1/2 without rounding.
    for (height, threshold) in [(9.0, 0.9), (5.0, 0.5)] {
        let picture = Picture {
            objects: vec![object(0, [0.0, 0.0, 10.0, 10.0])],
            detections: vec![found(0, [0.0, 0.0, 10.0, height], 0.5)],
        };
        let pictures = [picture];
        let ranking = Ranking::new(&pictures, 1, &Protocol::coco(), &Group::all());
        let t = ranking.thresholds().iter().position(|t| (t - threshold).abs() < 1e-9).unwrap();
        assert_eq!(ranking.classes[0].recall(t, 100), Some(1.0), "{threshold}");
        assert_eq!(ranking.classes[0].recall((t + 1).min(9), 100), Some(0.0));
    }
}

#[test]
fn nothing_to_find_and_nothing_found_are_told_apart() {
    let empty = coco_summary(&[Picture::default()], 2);
    assert_eq!((empty.ap, empty.ar100, empty.class_ap), (None, None, vec![None, None]));
    assert_eq!(coco_summary(&[], 0).ap, None);
    let missed = Picture { objects: vec![object(1, [0.0, 0.0, 5.0, 5.0])], detections: vec![] };
    assert_eq!(coco_summary(&[missed], 2).class_ap, [None, Some(0.0)]);
    // Not a number anywhere ends in no panic.
    let odd = Picture {
        objects: vec![TrueObject { area: 25.0, ..object(0, [f64::NAN, 0.0, 5.0, f64::INFINITY]) }],
        detections: (0..50).map(|i| found(0, [0.0; 4], if i % 3 == 0 { f64::NAN } else { 1.0 })).collect(),
    };
    assert_eq!(coco_summary(&[odd], 1).ap, Some(0.0));
}

/// Pictures with three objects each; a detector finds each with a chance, somewhat off, and reports others.
fn scenes(pictures: usize, chance: f64, seed: u64) -> Vec<Picture> {
    let mut truth = ChaCha8Rng::seed_from_u64(7);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut scene = || {
        let mut picture = Picture::default();
        for class in 0..3 {
            let bounds: Xywh = [
                truth.random_range(0.0..500.0),
                truth.random_range(0.0..400.0),
                truth.random_range(10.0..140.0),
                truth.random_range(10.0..80.0),
            ];
            picture.objects.push(object(class, bounds));
            if random.random_bool(chance) {
                let off = |v: f64, r: &mut ChaCha8Rng| v + r.random_range(-2.0..2.0);
                let seen = bounds.map(|v| off(v, &mut random));
                picture.detections.push(found(class, seen, random.random_range(0.3..1.0)));
            }
            if random.random_bool(0.3) {
                picture.detections.push(found(
                    class,
                    [10.0, 10.0, 30.0, 30.0],
                    random.random_range(0.0..0.7),
                ));
            }
        }
        picture
    };
    (0..pictures).map(|_| scene()).collect()
}

#[test]
fn a_picture_that_counts_twice_is_as_good_as_two() {
    let pictures = scenes(12, 0.7, 1);
    let counts: Vec<u32> = (0..12).map(|i| [0, 1, 3][i % 3]).collect();
    let copies: Vec<Picture> =
        pictures.iter().zip(&counts).flat_map(|(p, n)| std::iter::repeat_n(p.clone(), *n as usize)).collect();
    let of = |pictures: &[Picture]| Ranking::new(pictures, 3, &Protocol::coco(), &Group::all());
    let weighted = of(&pictures).average_precision(Interpolation::Points101, Some(&counts)).unwrap();
    let copied = of(&copies).average_precision(Interpolation::Points101, None).unwrap();
    assert!((weighted - copied).abs() < 1e-12, "{weighted} {copied}");
}

#[test]
fn the_interval_scatters_as_new_pictures_do_and_pairs_scatter_less() {
    let ranking = |pictures: &[Picture]| Ranking::new(pictures, 3, &Protocol::coco_at(0.5), &Group::all());
    let ap =
        |ranking: &Ranking, counts: &[u32]| ranking.average_precision(Interpolation::Points101, Some(counts));
    let (a, b) = (ranking(&scenes(80, 0.6, 1)), ranking(&scenes(80, 0.8, 2)));
    let how = Bootstrap { draws: 400, ..Bootstrap::of_pictures(80, 3) };
    let of_a = bootstrap(&how, |counts| ap(&a, counts)).unwrap();
    assert_eq!(bootstrap(&how, |counts| ap(&a, counts)).unwrap(), of_a, "the same seed");
    assert!(of_a.low < of_a.value && of_a.value < of_a.high);

    // The scatter over sets of new detections of as many pictures.
    let values: Vec<f64> =
        (0..60).map(|seed| ap(&ranking(&scenes(80, 0.6, 100 + seed)), &[1; 80]).unwrap()).collect();
    let mean = values.iter().sum::<f64>() / 60.0;
    let scatter = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 59.0).sqrt();
    let ratio = of_a.standard_error / scatter;
    println!("bootstrap {:.4}, new detections {scatter:.4}", of_a.standard_error);
    assert!((0.6..1.7).contains(&ratio), "{ratio}");

    let better = bootstrap(&how, |counts| Some(ap(&b, counts)? - ap(&a, counts)?)).unwrap();
    assert!(better.low > 0.0 && better.above_zero > 0.99, "{better:?}");
    // The draws of either camera are the same, so that their scores can be kept and subtracted draw by draw.
    let [of_a, of_b] = [&a, &b].map(|ranking| drawn_scores(&how, |counts| ap(ranking, counts)));
    let mut differences: Vec<f64> = of_a.iter().zip(&of_b).filter_map(|(a, b)| Some((*b)? - (*a)?)).collect();
    assert_eq!(percentiles(&mut differences, how.confidence), Some([better.low, better.high]));
    let equal = bootstrap(&how, |counts| Some(ap(&a, counts)? - ap(&a, counts)?)).unwrap();
    assert_eq!((equal.low, equal.high, equal.standard_error), (0.0, 0.0, 0.0));

    // Films of ten equal pictures say no more than one picture of each.
    let scene = scenes(10, 0.6, 5);
    let film: Vec<Picture> = scene.iter().flat_map(|p| std::iter::repeat_n(p.clone(), 10)).collect();
    let film = ranking(&film);
    let clusters = (0..100).map(|i| i / 10).collect();
    let by_film = Bootstrap { clusters, draws: 400, ..how };
    let by_picture = Bootstrap { clusters: (0..100).collect(), ..by_film.clone() };
    let [wide, narrow] =
        [&by_film, &by_picture].map(|how| bootstrap(how, |counts| ap(&film, counts)).unwrap().standard_error);
    assert!(wide > 2.0 * narrow, "{wide} {narrow}");
    // A single film says nothing about others.
    let one_film = Bootstrap { clusters: vec![0; 100], ..by_film.clone() };
    assert_eq!(bootstrap(&one_film, |counts| ap(&film, counts)), None);
}

#[test]
fn objects_outside_a_group_are_ignored() {
    // Two objects near the axis at (50, 50), one far away; the far one is found, and one near; a mistake is far away.
    let picture = Picture {
        objects: vec![
            object(0, [40.0, 40.0, 10.0, 10.0]),
            object(0, [55.0, 45.0, 10.0, 10.0]),
            object(0, [200.0, 45.0, 10.0, 10.0]),
        ],
        detections: vec![
            found(0, [200.0, 45.0, 10.0, 10.0], 0.9),
            found(0, [300.0, 45.0, 10.0, 10.0], 0.8),
            found(0, [40.0, 40.0, 10.0, 10.0], 0.7),
        ],
    };
    let pictures = [picture];
    let of = |group: &Group| {
        let ranking = Ranking::new(&pictures, 1, &Protocol::coco(), group);
        ranking.average_precision(Interpolation::AllPoints, None).unwrap()
    };
    let axis = [50.0, 50.0];
    // Near: one of two, without a mistake. Far: found before the mistake.
    assert!((of(&Group::of_distance(axis, 0.0, 100.0)) - 0.5).abs() < 1e-12);
    assert!((of(&Group::of_distance(axis, 100.0, 1e9)) - 1.0).abs() < 1e-12);
    let all = 1.0 / 3.0 + 1.0 / 3.0 * (2.0 / 3.0);
    assert!((of(&Group::all()) - all).abs() < 1e-12);
    let right_half = Group::of(|_, o| o.bounds[0] > 50.0, |_, d| d.bounds[0] > 50.0);
    assert!((of(&right_half) - 0.5).abs() < 1e-12);
}

#[test]
fn states_are_counted_for_objects_that_are_found() {
    let place = |i: usize| [30.0 * i as f64, 0.0, 10.0, 20.0];
    let mut picture = Picture { objects: (0..5).map(|i| object(0, place(i))).collect(), detections: vec![] };
    picture.objects[4].ignore = true;
    // Red as red, red as green, green not found, unknown, ignored; and a yellow one where nothing is.
    let states = [Some(0), Some(0), Some(2), None, Some(0)];
    let seen = [(0, 0), (1, 2), (3, 1), (4, 1), (7, 1)];
    picture.detections = seen.map(|(i, _)| found(0, place(i), 0.9)).into();
    // A second, less sure detection of the first object is spurious; one below the limit is none.
    picture.detections.extend([found(0, place(0), 0.6), found(0, place(2), 0.1)]);
    let found_states = [0, 2, 1, 1, 1, 3, 2];
    let of = StateOf { object: &|_, i| states[i], detection: &|_, d| Some(found_states[d]) };
    let confusion = StateConfusion::new(&[picture], LIGHT_STATES.len(), 0.5, &of);
    assert_eq!(confusion.counts[0], [1, 0, 1, 0]);
    assert_eq!((confusion.detected(), confusion.accuracy()), (2, Some(0.5)));
    assert_eq!(confusion.missed, [0, 0, 1, 0]);
    assert_eq!(confusion.spurious, [0, 1, 0, 1]);
    assert_eq!((confusion.recall(0), confusion.recall(2), confusion.recall(1)), (Some(0.5), Some(0.0), None));
    assert_eq!(StateConfusion::new(&[], 4, 0.5, &of).accuracy(), None);
    let named = ["traffic light red", "Yellow", "green_arrow", "off", "left", ""].map(light_state);
    assert_eq!(named, [Some(0), Some(1), Some(2), Some(3), None, None]);
}

#[test]
fn ten_thousand_boxes_in_a_picture_are_scored_soon() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut bounds = || [random.random_range(0.0..1900.0), random.random_range(0.0..1000.0), 12.0, 9.0];
    let objects: Vec<TrueObject> = (0..10_000).map(|_| object(0, bounds())).collect();
    let detections = objects.iter().enumerate().map(|(i, o)| found(0, o.bounds, i as f64)).collect();
    let pictures = [Picture { objects, detections }];
    let start = std::time::Instant::now();
    let ar = coco_summary(&pictures, 1).ar100.unwrap();
    assert!((ar - 0.01).abs() < 1e-12, "100 of 10 000");
    assert!(voc_average_precision(&pictures, 1, Interpolation::AllPoints)[0].unwrap() > 0.99);
    println!("{:?}", start.elapsed());
    assert!(start.elapsed().as_secs() < 20);
}

#[test]
fn a_crowd_around_an_object_takes_no_detection_from_it() {
    let crowd = TrueObject { crowd: true, ..object(0, [0.0, 0.0, 200.0, 100.0]) };
    let picture = Picture {
        objects: vec![object(0, [10.0, 10.0, 20.0, 40.0]), crowd],
        // On the object, not quite; and somewhere in the crowd.
        detections: vec![found(0, [11.0, 10.0, 20.0, 40.0], 0.8), found(0, [120.0, 10.0, 20.0, 40.0], 0.9)],
    };
    for area in [Interpolation::AllPoints, Interpolation::Points11] {
        let found = voc_average_precision(std::slice::from_ref(&picture), 1, area)[0].unwrap();
        assert!((found - 1.0).abs() < 1e-12, "{found}");
    }
}

/// Boxes and figures are those of `fixtures/overhanging_boxes.py`.
#[test]
fn truth_that_overhangs_has_the_figures_of_pycocotools_whole_and_clipped() {
    let truth: [(u64, [f64; 4]); 6] = [
        (1, [-20.0, 10.0, 40.0, 30.0]),
        (1, [60.0, 30.0, 60.0, 50.0]),
        (1, [30.0, 5.0, 20.0, 20.0]),
        (2, [80.0, -15.0, 30.0, 40.0]),
        (2, [10.0, 20.0, 40.0, 30.0]),
        (2, [-5.0, 40.0, 30.0, 30.0]),
    ];
    let found: [(u64, [f64; 4], f64); 8] = [
        (1, [0.0, 10.0, 20.0, 30.0], 0.9),
        (1, [62.0, 31.0, 38.0, 29.0], 0.8),
        (1, [31.0, 6.0, 19.0, 18.0], 0.7),
        (1, [70.0, 5.0, 10.0, 10.0], 0.6),
        (2, [81.0, 0.0, 19.0, 24.0], 0.85),
        (2, [12.0, 21.0, 37.0, 28.0], 0.75),
        (2, [0.0, 41.0, 24.0, 19.0], 0.65),
        (2, [50.0, 5.0, 20.0, 12.0], 0.3),
    ];
    let images = [1, 2].map(
        |id| serde_json::json!({"id": id, "file_name": format!("{id}.png"), "width": 100, "height": 60}),
    );
    let objects = (1..).zip(&truth).map(|(id, (image, bounds))| {
        let area = bounds[2] * bounds[3];
        serde_json::json!({"id": id, "image_id": image, "category_id": 1, "bbox": bounds, "area": area})
    });
    let file = serde_json::json!({
        "images": images, "categories": [{"id": 1, "name": "car"}], "annotations": objects.collect::<Vec<_>>()
    });
    let mut defects = coco::Defects::default();
    let mut data = coco::parse_coco(file.to_string().into_bytes(), &mut defects).unwrap();
    coco::check_values(&mut data, &mut defects);
    assert_eq!(defects.count(coco::DefectKind::ClippedBox), 4);
    let detections = found.map(|(image_id, bounds, score)| coco::Detection {
        image_id,
        category_id: 1,
        bounds: bounds.into(),
        score,
    });
    let whole = data.unclipped();
    assert!(whole.annotations.iter().all(|object| object.unclipped.is_none()));
    for (data, ap, ap50, ap75, ar100) in [
        (&whole, 0.14409240924092412, 0.4983498349834984, 0.13465346534653466, 0.3),
        (&data, 0.8778877887788779, 1.0, 1.0, 0.8833333333333332),
    ] {
        let (pictures, classes) = pictures_of_data_set(data, &detections);
        let summary = coco_summary(&pictures, classes.len());
        let figures = [summary.ap, summary.ap50, summary.ap75, summary.ar100];
        for (found, wanted) in figures.into_iter().zip([ap, ap50, ap75, ar100]) {
            near(found, &wanted.into(), "overhanging");
        }
    }
}
