//! A file of Pascal VOC: what one picture shows.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use petzval_base::{FileError, quote};
use roxmltree::{Document, Node, ParsingOptions};

use crate::coco::bounds::Bounds;
use crate::coco::data_set::Attribute;
use crate::coco::loose::Loose;
use crate::coco::rotation::{NO_UNIT, UNIT_HINT, is_angle, is_rotation, take_rotation_deg, unread_angles};

/// Elements and texts of a file that are read.
const MOST_NODES: u32 = 1_000_000;

/// Attributes of an element that are read. The reader compares each with all others.
const MOST_ATTRIBUTES: usize = 1000;

/// Namespaces that a file may declare. The reader keeps a list of them for each element.
const MOST_NAMESPACES: usize = 100;

/// Elements of a file that say nothing of its objects.
const ABOUT_FILE: [&str; 8] =
    ["folder", "filename", "path", "source", "owner", "size", "segmented", "object"];

/// Elements of an object that are read, or that say nothing of it.
const OF_OBJECT: [&str; 10] =
    ["name", "bndbox", "robndbox", "difficult", "truncated", "occluded", "pose", "attributes", "type", "id"];

/// Elements of an upright box that are read.
const OF_BOX: [&str; 4] = ["xmin", "ymin", "xmax", "ymax"];

/// Elements of a rotated box that are read.
const OF_ROTATED_BOX: [&str; 5] = ["cx", "cy", "w", "h", "angle"];

/// The element with the points of an outline.
const OUTLINE: &str = "polygon";

/// A file of labels.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Labels {
    pub file_name: Option<String>,
    /// Columns and rows, if the file states them, px.
    pub size: Option<(u32, u32)>,
    pub objects: Vec<Object>,
    /// Elements that are not read, each time that one occurs.
    pub unread: Vec<String>,
}

/// What the bounds of an object are in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// An upright box.
    Upright,
    /// A rotated box; the bounds are those around it.
    Rotated,
    /// The points of an outline; the bounds are those around it.
    Outline,
}

#[derive(Debug, PartialEq)]
pub(super) struct Object {
    pub class: String,
    pub bounds: Bounds,
    pub form: Form,
    pub is_difficult: bool,
    pub attributes: BTreeMap<String, Attribute>,
}

/// Reads the text of a file.
pub(super) fn parse(text: &str) -> Result<Labels, FileError> {
    check_tags(text)?;
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document =
        Document::parse_with_options(text.trim_start_matches('\u{feff}'), options).map_err(|e| {
            let is_cut_off =
                matches!(e, roxmltree::Error::UnexpectedEndOfStream | roxmltree::Error::UnclosedRootNode);
            // The reader gives no place for the end of the file.
            let (line, column, hint) = if is_cut_off {
                (text.trim_end().lines().count() as u32, None, "the file is cut off; copy or export it again")
            } else {
                (e.pos().row, Some(e.pos().col), "correct the line, or export the file again")
            };
            let message = e.to_string();
            let reason = message.split(" at ").next().unwrap_or(&message);
            let record = text.lines().nth(line.saturating_sub(1) as usize).unwrap_or("");
            let error = FileError::at_line(line, record, format!("this is not XML: {reason}")).hint(hint);
            FileError { line: Some(line), column, ..error }
        })?;
    let root = document.root_element();
    if root.tag_name().name() != "annotation" {
        return Err(error(root, "the outermost element is not `annotation`", "give files of Pascal VOC"));
    }
    let size = match child(root, "size")? {
        // Zeros stand for a size that is not known.
        Some(size) => Some((whole(size, "width")?, whole(size, "height")?)).filter(|(w, h)| *w > 0 && *h > 0),
        None => None,
    };
    let mut labels = Labels { file_name: text_of(root, "filename")?, size, ..Labels::default() };
    for node in root.children().filter(Node::is_element) {
        if node.has_tag_name("object") {
            labels.objects.push(read_object(node, &mut labels.unread)?);
        } else if !ABOUT_FILE.contains(&node.tag_name().name()) {
            labels.unread.push(node.tag_name().name().to_owned());
        }
    }
    Ok(labels)
}

/// Refuses text whose tags would take the reader very long: its time grows with the square of the attributes of an element.
fn check_tags(text: &str) -> Result<(), FileError> {
    let mut namespaces = 0;
    // No tag holds the sign with which the next one begins.
    for (i, piece) in text.split('<').enumerate() {
        let attributes = attributes_of(piece);
        namespaces += piece.matches("xmlns").count();
        if attributes > MOST_ATTRIBUTES || namespaces > MOST_NAMESPACES {
            let before: usize = text.split('<').take(i).map(|piece| piece.len() + 1).sum();
            let line = 1 + text[..before].matches('\n').count() as u32;
            let message = format!(
                "an element has more than {MOST_ATTRIBUTES} attributes, or the file more than {MOST_NAMESPACES} namespaces"
            );
            return Err(FileError::at_line(line, piece, message)
                .hint("files of Pascal VOC have no attributes; export the file again"));
        }
    }
    Ok(())
}

/// The attributes of a tag, by their signs of equality; what is in quotes or behind the tag does not count.
fn attributes_of(piece: &str) -> usize {
    let (mut quote, mut count) = (None, 0);
    for byte in piece.bytes() {
        match (quote, byte) {
            (Some(open), _) => quote = Some(open).filter(|open| *open != byte),
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'>') => break,
            (None, b'=') => count += 1,
            _ => {}
        }
    }
    count
}

fn read_object(object: Node, unread: &mut Vec<String>) -> Result<Object, FileError> {
    let Some(class) = text_of(object, "name")?.filter(|name| !name.is_empty()) else {
        return Err(error(object, "the object has no `name`", "add the name of its class"));
    };
    let mut attributes = further_attributes(object, unread)?;
    let (bounds, form) = bounds_of(object, &mut attributes, unread)?;
    for name in ["truncated", "occluded"] {
        if let Some(is_set) = flag(object, name)? {
            attributes.insert(name.to_owned(), Attribute::Flag(is_set));
        }
    }
    // Views of an object; `Unspecified` is none.
    if let Some(pose) = text_of(object, "pose")?.filter(|pose| !pose.is_empty() && pose != "Unspecified") {
        attributes.insert("pose".to_owned(), Attribute::Text(pose));
    }
    let is_difficult = flag(object, "difficult")?.unwrap_or(false);
    let elements = object.children().filter(Node::is_element).map(|node| node.tag_name().name());
    // An outline beside a box is not read.
    let is_read = |name: &str| OF_OBJECT.contains(&name) || form == Form::Outline && name == OUTLINE;
    unread.extend(elements.filter(|name| !is_read(name)).map(|name| format!("object/{name}")));
    Ok(Object { class, bounds, form, is_difficult, attributes })
}

/// The bounds of an object, and the form in which its file has them.
fn bounds_of(
    object: Node,
    attributes: &mut BTreeMap<String, Attribute>,
    unread: &mut Vec<String>,
) -> Result<(Bounds, Form), FileError> {
    let rotation_deg = take_rotation_deg(attributes)
        .map_err(|value| error(object, format!("the rotation is {value}"), "write one angle in degrees"))?;
    match (child(object, "bndbox")?, child(object, "robndbox")?) {
        (Some(corners), None) => {
            check_box(corners, &OF_BOX, unread)?;
            let value = |name| number(corners, name);
            // Pixels are counted from 1, and the last one is inside.
            let (left, top) = (value("xmin")? - 1.0, value("ymin")? - 1.0);
            let bounds = Bounds::between(left, top, value("xmax")?, value("ymax")?);
            Ok(match rotation_deg {
                Some(degrees) => (bounds.around_rotated(degrees.to_radians()), Form::Rotated),
                None => (bounds, Form::Upright),
            })
        }
        (None, _) if rotation_deg.is_some() => {
            let message = "an attribute rotates the object, which has no `bndbox`";
            Err(error(object, message, "take the attribute out, or write the box before it is rotated"))
        }
        (None, Some(rotated)) => {
            check_box(rotated, &OF_ROTATED_BOX, unread)?;
            let value = |name| number(rotated, name);
            let (width, height) = (value("w")?, value("h")?);
            let (x, y) = (value("cx")? - 0.5 * width, value("cy")? - 0.5 * height);
            Ok((Bounds { x, y, width, height }.around_rotated(angle_rad(rotated)?), Form::Rotated))
        }
        (None, None) => match child(object, OUTLINE)? {
            Some(outline) => Ok((around_outline(outline)?, Form::Outline)),
            None => Err(error(object, "the object has no box and no outline", FORMS)),
        },
        (Some(_), Some(_)) => {
            Err(error(object, "the object has both `bndbox` and `robndbox`", "keep the one that is meant"))
        }
    }
}

/// Notes the elements of a box that are not read. Fails where one of them is an angle, in a unit that nothing states.
fn check_box(of_box: Node, read: &[&str], unread: &mut Vec<String>) -> Result<(), FileError> {
    for node in of_box.children().filter(Node::is_element) {
        let (name, text) = (node.tag_name().name(), all_text(node));
        if read.contains(&name) {
            continue;
        }
        if is_angle(name) && !is_zero(&text) {
            let at = error(node, NO_UNIT, UNIT_HINT);
            return Err(FileError { key: name.to_owned(), value: quote(&text), ..at });
        }
        unread.push(format!("object/{}/{name}", of_box.tag_name().name()));
    }
    Ok(())
}

/// Whether the text for an angle rotates nothing.
fn is_zero(text: &str) -> bool {
    text.is_empty() || text.eq_ignore_ascii_case("false") || text.parse().is_ok_and(|angle: f64| angle == 0.0)
}

/// The angle of a rotated box of roLabelImg, rad. Fails beyond a full turn, which is an angle in degrees.
fn angle_rad(rotated: Node) -> Result<f64, FileError> {
    let angle = number(rotated, "angle")?;
    if angle.abs() <= TAU {
        return Ok(angle);
    }
    let hint = "angles of roLabelImg are radians, 0 to pi: multiply degrees by pi / 180";
    let at = error(rotated, "this is more than a full turn", hint);
    Err(FileError { key: "angle".to_owned(), value: angle.to_string(), ..at })
}

/// What an object may have.
const FORMS: &str = "add `bndbox` with xmin, ymin, xmax and ymax, `robndbox` with cx, cy, w, h and angle, or `polygon` with x1, y1, x2, y2 and so on";

/// Fewest points of an outline.
const LEAST_POINTS: usize = 3;

/// The smallest upright box around an outline: `x1`, `y1`, `x2`, `y2` and so on in pixels, or as in LabelMe `pt` with `x` and `y` for each point.
fn around_outline(outline: Node) -> Result<Bounds, FileError> {
    let mut points = Vec::new();
    let mut numbered: BTreeMap<u32, [Option<f64>; 2]> = BTreeMap::new();
    for node in outline.children().filter(Node::is_element) {
        let name = node.tag_name().name();
        let axis = ['x', 'y'].iter().position(|axis| name.starts_with(*axis));
        let place: Option<u32> = name.get(1..).and_then(|place| place.parse().ok());
        match (axis, place) {
            (Some(axis), Some(place)) => {
                let value = &mut numbered.entry(place).or_default()[axis];
                if value.replace(number_in(node, name)?).is_some() {
                    return Err(error(node, "there are two of these", "keep one"));
                }
            }
            _ if name == "pt" => points.push([number(node, "x")?, number(node, "y")?]),
            _ => {}
        }
    }
    for (place, point) in numbered {
        let [Some(x), Some(y)] = point else {
            let message = format!("the point {place} has no x or no y");
            return Err(error(outline, message, "write a number of pixels for both"));
        };
        points.push([x, y]);
    }
    let bounds = Bounds::around(points.iter().copied()).filter(|_| points.len() >= LEAST_POINTS);
    bounds.ok_or_else(|| {
        let message = format!("an outline of {} points has no inside", points.len());
        error(outline, message, "give three points or more: x1, y1, x2, y2 and so on, or `pt` with x and y")
    })
}

/// The facts below `attributes`, as CVAT writes them.
fn further_attributes(
    object: Node,
    unread: &mut Vec<String>,
) -> Result<BTreeMap<String, Attribute>, FileError> {
    let mut facts = BTreeMap::new();
    let mut stated: Vec<(String, Loose)> = Vec::new();
    let Some(list) = child(object, "attributes")? else { return Ok(facts) };
    for fact in list.children().filter(Node::is_element) {
        let (Some(name), Some(text)) = (text_of(fact, "name")?, text_of(fact, "value")?) else {
            unread.push(format!("object/attributes/{}", fact.tag_name().name()));
            continue;
        };
        let of_text = |text: &String| match text.as_str() {
            "" => Loose::Absent,
            text if is_zero(text) => Loose::Flag(false),
            text => Loose::Text(text.to_owned()),
        };
        stated.push((name.clone(), text.parse().map_or_else(|_| of_text(&text), Loose::Number)));
        let value = match text.parse() {
            Ok(number) if f64::is_finite(number) => Attribute::Number(number),
            _ if is_rotation(&name) && !is_zero(&text) => {
                return Err(error(fact, "the rotation is no number", "write an angle in degrees"));
            }
            _ if text.eq_ignore_ascii_case("true") => Attribute::Flag(true),
            _ if text.eq_ignore_ascii_case("false") => Attribute::Flag(false),
            _ if is_rotation(&name) => continue,
            _ => Attribute::Text(text),
        };
        facts.insert(name, value);
    }
    let angles = unread_angles(stated.iter().map(|(name, value)| (name, value)));
    unread.extend(angles.map(|name| format!("object/attributes/{name}")));
    Ok(facts)
}

/// The only element of a name below a node; `None` if there is none.
fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Result<Option<Node<'a, 'b>>, FileError> {
    let mut named = node.children().filter(|child| child.has_tag_name(name));
    match (named.next(), named.next()) {
        (_, Some(second)) => Err(error(second, "there are two of these", "keep one")),
        (first, None) => Ok(first),
    }
}

/// The text in an element; `None` if there is no such element.
fn text_of(node: Node, name: &str) -> Result<Option<String>, FileError> {
    Ok(child(node, name)?.map(all_text))
}

/// The whole text in an element, also around comments.
fn all_text(element: Node) -> String {
    let texts = element.children().filter(Node::is_text).filter_map(|node| node.text());
    texts.collect::<String>().trim().to_owned()
}

/// Whether a mark of an object is set; `None` if it is not there or not stated.
fn flag(object: Node, name: &'static str) -> Result<Option<bool>, FileError> {
    let Some(text) = text_of(object, name)? else { return Ok(None) };
    match text.to_ascii_lowercase().as_str() {
        "1" | "true" | "yes" => Ok(Some(true)),
        "0" | "false" | "no" => Ok(Some(false)),
        "" | "unspecified" => Ok(None),
        _ => Err(FileError {
            key: name.to_owned(),
            value: quote(&text),
            ..error(object, "this is neither 0 nor 1", "write 0 or 1")
        }),
    }
}

/// The whole number in an element, from 0.
fn whole(node: Node, name: &'static str) -> Result<u32, FileError> {
    let found = number(node, name)?;
    if (0.0..=f64::from(u32::MAX)).contains(&found) && found.fract() == 0.0 {
        return Ok(found as u32);
    }
    let at = error(node, "this is no whole number from 0", "write the size of the picture");
    Err(FileError { key: name.to_owned(), value: found.to_string(), ..at })
}

/// The number in an element.
fn number(node: Node, name: &'static str) -> Result<f64, FileError> {
    let Some(element) = child(node, name)? else {
        return Err(error(node, format!("`{name}` is missing"), "write a number of pixels"));
    };
    number_in(element, name)
}

/// The number that is the text of an element of this name.
fn number_in(element: Node, name: &str) -> Result<f64, FileError> {
    let text = all_text(element);
    text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
        let found = error(element, "this is no number", "write a number of pixels");
        FileError { key: name.to_owned(), value: quote(&text), ..found }
    })
}

fn error(node: Node, message: impl Into<String>, hint: &str) -> FileError {
    let place = node.document().text_pos_at(node.range().start);
    let value = format!("<{}>", node.tag_name().name());
    let error = FileError::at_line(0, "", message).hint(hint);
    FileError { line: Some(place.row), column: Some(place.col), value, ..error }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(object: &str) -> String {
        format!("<annotation>\n<object><name>car</name>{object}</object></annotation>")
    }

    const BOX: &str = "<bndbox><xmin>11</xmin><ymin>21</ymin><xmax>30</xmax><ymax>30</ymax></bndbox>";

    fn object(text: &str) -> Object {
        parse(&file(text)).unwrap().objects.remove(0)
    }

    fn wrong(text: &str) -> String {
        parse(&file(text)).unwrap_err().to_string()
    }

    #[test]
    fn rotated_boxes_become_those_around_them() {
        let upright = object(BOX);
        assert_eq!((upright.bounds, upright.form), (Bounds::from([10.0, 20.0, 20.0, 10.0]), Form::Upright));
        // A quarter turn about the middle, (20, 25): 10 wide and 20 high.
        let wanted = [15.0, 15.0, 10.0, 20.0];
        let attribute = "<attributes><attribute><name>rotation</name><value>90.0</value></attribute>\
                         <attribute><name>parked</name><value>True</value></attribute></attributes>";
        let of_cvat = object(&format!("{BOX}{attribute}"));
        let of_rolabelimg = object(
            "<robndbox><cx>20</cx><cy>25</cy><w>20</w><h>10</h><angle>1.5707963267948966</angle></robndbox>",
        );
        for found in [&of_cvat, &of_rolabelimg] {
            let close = |(a, b): (f64, f64)| (a - b).abs() < 1e-9;
            assert!(
                found.form == Form::Rotated
                    && <[f64; 4]>::from(found.bounds).into_iter().zip(wanted).all(close)
            );
        }
        assert_eq!(of_cvat.attributes["parked"], Attribute::Flag(true));
        let not_turned = object(&format!("{BOX}{}", attribute.replace("90.0", "0.0")));
        assert_eq!(not_turned.form, Form::Upright);
        let in_capitals = object(&format!("{BOX}{}", attribute.replace("rotation", "Rotation")));
        assert_eq!((in_capitals.bounds, in_capitals.form), (of_cvat.bounds, Form::Rotated));
    }

    #[test]
    fn rotations_of_unknown_forms_are_refused_or_counted() {
        let within = |element: &str| BOX.replace("</bndbox>", &format!("{element}</bndbox>"));
        for (element, value) in [("angle", "0.5"), ("rotation", "30")] {
            let text = wrong(&within(&format!("<{element}>{value}</{element}>")));
            let quoted = format!("`{element} = {value}`: {NO_UNIT}");
            assert!(text.contains(&quoted) && text.contains("degrees about the middle"), "{text}");
        }
        let unread = |text: &str| parse(&file(text)).unwrap().unread;
        assert_eq!(unread(&within("<angle>0.0</angle>")), ["object/bndbox/angle"]);
        assert_eq!(unread(&within("<depth>3</depth>")), ["object/bndbox/depth"]);
        let attribute = |name: &str, value: &str| {
            let fact = format!("<attribute><name>{name}</name><value>{value}</value></attribute>");
            format!("<attributes>{fact}</attributes>")
        };
        assert_eq!(unread(&format!("{BOX}{}", attribute("angle", "30"))), ["object/attributes/angle"]);
        assert!(unread(&format!("{BOX}{}", attribute("angle", "0"))).is_empty());
        let text = wrong(&format!("{BOX}{}", attribute("rotation", "30,5")));
        assert!(text.contains("the rotation is no number"), "{text}");
        // In other letters it may be another fact.
        assert_eq!(
            unread(&format!("{BOX}{}", attribute("Rotation", "left"))),
            ["object/attributes/Rotation"]
        );
        assert!(unread(&format!("{BOX}{}", attribute("rotation", "false"))).is_empty());
        let both = attribute("rotation", "false")
            .replace("</attributes>", &attribute("Rotation", "30").replace("<attributes>", ""));
        assert_eq!(unread(&format!("{BOX}{both}")), ["object/attributes/Rotation"]);
        assert_eq!(unread(&format!("{BOX}{}", attribute("Rotation", "nan"))), ["object/attributes/Rotation"]);
        assert_eq!(unread(&within("<rotated>false</rotated>")), ["object/bndbox/rotated"]);

        let rotated = |angle: &str| {
            format!("<robndbox><cx>20</cx><cy>25</cy><w>20</w><h>10</h><angle>{angle}</angle></robndbox>")
        };
        assert_eq!(object(&rotated("3.1")).form, Form::Rotated);
        let text = wrong(&rotated("40"));
        assert!(text.contains("`angle = 40`") && text.contains("radians, 0 to pi"), "{text}");
        let twice = wrong(&format!("{}{}", rotated("0.7"), attribute("rotation", "30")));
        assert!(twice.contains("which has no `bndbox`"), "{twice}");
    }

    #[test]
    fn outlines_become_the_boxes_around_them() {
        let points = "<x1>10</x1><y1>12</y1><x2>80</x2><y2>10</y2><x3>40</x3><y3>70.5</y3>";
        let pairs = "<pt><x>10</x><y>12</y></pt><pt><x>80</x><y>10</y></pt><pt><x>40</x><y>70.5</y></pt>";
        for outline in [points, pairs] {
            let found = object(&format!("<polygon>{outline}</polygon>"));
            let wanted = Bounds::from([10.0, 10.0, 70.0, 60.5]);
            assert_eq!((found.bounds, found.form), (wanted, Form::Outline));
            let text = file(&format!("<polygon>{outline}</polygon>"));
            assert!(parse(&text).unwrap().unread.is_empty());
        }
        let nothing = wrong("");
        assert!(nothing.contains("no box and no outline") && nothing.contains("`polygon`"), "{nothing}");
        assert!(nothing.contains("xmin") && nothing.contains("`robndbox`"), "{nothing}");
        let half = wrong(&format!("<polygon>{}</polygon>", points.replace("<y2>10</y2>", "")));
        assert!(half.contains("the point 2 has no x or no y"), "{half}");
        assert!(wrong("<polygon/>").contains("an outline of 0 points has no inside"));
        assert!(
            wrong(&format!("<polygon>{}</polygon>", points.replace("70.5", "far"))).contains("no number")
        );
    }

    #[test]
    fn marks_are_0_or_1_and_nothing_is_there_twice() {
        let difficult = |text: &str| object(&format!("{BOX}<difficult>{text}</difficult>")).is_difficult;
        assert!(difficult("1") && difficult("true") && !difficult("0") && !difficult("Unspecified"));
        assert!(
            !object(&format!("{BOX}<truncated>Unspecified</truncated>")).attributes.contains_key("truncated")
        );
        assert!(
            wrong(&format!("{BOX}<difficult>2</difficult>"))
                .contains("`difficult = 2`: this is neither 0 nor 1")
        );
        assert!(wrong(&format!("{BOX}{BOX}")).contains("there are two of these"));
        assert!(wrong(&format!("{BOX}<name>bus</name>")).contains("there are two of these"));
    }

    #[test]
    fn elements_that_are_not_read_are_listed() {
        let text = file(&format!("{BOX}<part><name>head</name></part><polygon/>"));
        let text = text.replace("<object>", "<actions/><object>");
        assert_eq!(parse(&text).unwrap().unread, ["actions", "object/part", "object/polygon"]);
        assert_eq!(object(&BOX.replace("11", "1<!-- left -->1")).bounds.x, 10.0);
    }

    #[test]
    fn very_many_attributes_are_refused_at_once() {
        let many = |n: usize| (0..n).map(|i| format!(" a{i}='>'")).collect::<String>();
        let with = |n: usize| file(BOX).replace("<object>", &format!("<object{}>", many(n)));
        assert!(parse(&with(1000)).is_ok());
        let start = std::time::Instant::now();
        let error = parse(&with(200_000)).unwrap_err();
        assert_eq!(error.line, Some(2));
        assert!(error.message.contains("more than 1000 attributes"), "{error}");
        assert!(start.elapsed().as_secs() < 5);
        // Signs of equality in a text are no attributes.
        assert!(parse(&file(&format!("{BOX}<pose>{}</pose>", "=".repeat(5000)))).is_ok());
        let nested: String = (0..300).map(|i| format!("<a xmlns:b{i}='c'>")).collect();
        assert!(parse(&nested).unwrap_err().message.contains("namespaces"));
    }
}
