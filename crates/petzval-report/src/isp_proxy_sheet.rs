//! Pictures of a network beside those of the ISP that it imitates, on one self-contained page: what the imitation costs, first.

use image::{Rgb, RgbImage};
use maud::{Markup, html};

use crate::page::{Page, Section, Tile, caption, figure, numbers, section, with_contents};
use crate::plot::{Bar, BarChart, BarKey, bars_svg, plain};
use crate::rgb_picture::{rgb_picture, shrunk};
use crate::table::{Column, Row, Table};
use crate::{number, png};

/// A proxy, how far it is from its ISP, and pictures of both.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Name of the ISP.
    pub isp: String,
    /// Frames of unseen scenes on which the figures were measured.
    pub frames: usize,
    /// PSNR of the proxy's pictures against those of the ISP, dB: with the parameters about which it was trained, near them, and far from
    /// them.
    pub psnr_db: [f64; 3],
    /// Scores of either against the truth.
    pub scores: Vec<ScoreRow>,
    /// Cosine between the gradients of the mean squared error through ISP and proxy, -1..1.
    pub gradient_cosine: f64,
    /// Both gradients, a row for each parameter.
    pub slopes: Vec<Slope>,
    /// Some of the frames.
    pub pictures: Vec<Pair>,
}

/// A score of the ISP's pictures beside that of the proxy's.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoreRow {
    /// Its name.
    pub title: String,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Digits after the decimal point.
    pub decimals: usize,
    /// Of the ISP.
    pub isp: f64,
    /// Of the proxy.
    pub proxy: f64,
}

/// The slope of the mean squared error by the place of a parameter in its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Slope {
    /// Name of the parameter.
    pub parameter: String,
    /// Through the ISP, by differences.
    pub isp: f64,
    /// Through the proxy.
    pub proxy: f64,
}

/// A frame as the ISP and as the proxy develop it.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Three planes of the ISP, sRGB-encoded, 0..1.
    pub isp: Vec<f32>,
    /// Three planes of the proxy, in the same encoding.
    pub proxy: Vec<f32>,
}

/// Columns of a shown picture, pixels.
const WIDTH: u32 = 480;

/// By how much differences are amplified, so that one step of 8 bits in 32 of the range shows.
const AMPLIFIED: f32 = 8.0;

/// The page of a proxy.
pub fn page(sheet: &Sheet) -> String {
    let [centre, near, far] = sheet.psnr_db;
    let tiles = [
        (db(centre), "PSNR against the ISP, with the parameters of the training"),
        (db(far), "PSNR against the ISP, with a tenth of the parameters anywhere"),
        (
            number::fixed(sheet.gradient_cosine, 2),
            "cosine between both gradients beside the parameters of the training; 1: the same direction",
        ),
    ];
    let tiles = tiles.map(|(value, label)| Tile { value, label: label.to_owned(), is_gain: None });
    let sections: Vec<Section> = [
        Some(section("Side by side", side_by_side(sheet))),
        Some(section("Gap", gap(sheet, near))),
        (!sheet.slopes.is_empty()).then(|| section("Gradients", gradients(sheet))),
    ]
    .into_iter()
    .flatten()
    .collect();
    Page {
        title: format!("{} and its proxy", plain(&sheet.isp)),
        style: include_str!("side_by_side/page.css"),
        headline: format!("{} and its proxy", plain(&sheet.isp)),
        lead: html! { p.lead { (sentence(sheet)) } (numbers(&tiles)) },
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// How near the pictures are, and whether the gradient leads where that of the ISP does.
fn sentence(sheet: &Sheet) -> String {
    let way = match sheet.gradient_cosine {
        c if c >= 0.7 => "leads where that of the ISP leads",
        c if c > 0.3 => "leads roughly where that of the ISP leads",
        c if c > -0.3 => "has little to do with that of the ISP",
        _ => "leads away from where that of the ISP leads",
    };
    format!(
        "On {} frames of unseen scenes the proxy is within {} of the ISP, and its gradient {way} (cosine {}).",
        sheet.frames,
        db(sheet.psnr_db[0]),
        number::fixed(sheet.gradient_cosine, 2)
    )
}

fn db(value: f64) -> String {
    number::with_unit(value, 1, "dB")
}

/// Each frame by ISP and proxy, and their difference.
fn side_by_side(sheet: &Sheet) -> Markup {
    html! {
        @for (i, pair) in sheet.pictures.iter().enumerate() {
            div.views {
                (view("ISP", i, &rgb_picture(&pair.isp, pair.height, pair.width)))
                (view("proxy", i, &rgb_picture(&pair.proxy, pair.height, pair.width)))
                (view("difference", i, &difference(pair)))
            }
        }
        (caption(html! { "Differences of encoded values are " (AMPLIFIED) " times as large, about middle gray." }))
    }
}

fn view(who: &str, i: usize, picture: &RgbImage) -> Markup {
    let name = format!("{who}, frame {}", i + 1);
    html! {
        figure {
            img.pixels src=(png::address(&png::encode(&shrunk(picture, WIDTH)))) alt=(name);
            figcaption { (name) }
        }
    }
}

/// The proxy's picture less the ISP's, amplified about middle gray.
fn difference(pair: &Pair) -> RgbImage {
    let clamped = |v: f32| v.clamp(0.0, 1.0);
    let planes = pair.isp.iter().zip(&pair.proxy);
    let shown: Vec<f32> =
        planes.map(|(isp, proxy)| 0.5 + AMPLIFIED * (clamped(*proxy) - clamped(*isp))).collect();
    let picture = rgb_picture(&shown, pair.height, pair.width);
    // A picture that lacks values is black, as the others are.
    if shown.is_empty() { RgbImage::from_pixel(1, 1, Rgb([0; 3])) } else { picture }
}

/// How far the pictures of both are from each other, and what that does to the scores.
fn gap(sheet: &Sheet, near: f64) -> Markup {
    let [centre, _, far] = sheet.psnr_db;
    let rows = [
        ("of the training", centre),
        ("near them, drawn for every frame", near),
        ("a tenth of them anywhere in their ranges", far),
    ];
    let rows = rows.map(|(name, value)| Row::new(name, [number::fixed(value, 1)]));
    let columns = [Column::new("parameters"), Column::new("PSNR of proxy against ISP").unit("dB")];
    let scores = sheet.scores.iter().map(|score| {
        let text = |value: f64| number::with_unit(value, score.decimals, &score.unit);
        let gap = number::signed(score.proxy - score.isp, score.decimals);
        Row::new(&score.title, [text(score.isp), text(score.proxy), gap])
    });
    let heads = ["score against the truth", "ISP", "proxy", "gap"].map(Column::new);
    html! {
        (Table::new(columns).class("narrow").rows(rows).html())
        (Table::new(heads).class("narrow").rows(scores).html())
        (caption(html! {
            "Means over " (sheet.frames) " frames of scenes that training has not seen. The truth of a frame is what the ISP makes of the same scene through perfect optics and without noise."
        }))
    }
}

/// Both gradients, each of unit length, so that their directions can be compared by eye.
fn gradients(sheet: &Sheet) -> Markup {
    let length = |of: fn(&Slope) -> f64| {
        sheet.slopes.iter().map(|s| of(s).powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE)
    };
    let (isp, proxy) = (length(|s| s.isp), length(|s| s.proxy));
    let mut order: Vec<&Slope> = sheet.slopes.iter().collect();
    order.sort_by(|a, b| (b.isp / isp).abs().total_cmp(&(a.isp / isp).abs()));
    let bar = |s: &&Slope| Bar { name: words(&s.parameter), values: vec![s.isp / isp, s.proxy / proxy] };
    let chart = BarChart {
        alt: "Both gradients by each parameter, each of unit length".into(),
        axis: "part of the unit gradient".into(),
        keys: vec![BarKey::nth(0, "through the ISP, by differences"), BarKey::nth(1, "through the proxy")],
        bars: order.iter().take(MOST_BARS).map(bar).collect(),
    };
    let row = |s: &&Slope| {
        Row::new(
            html! { code { (plain(&s.parameter)) } },
            [number::significant(s.isp), number::significant(s.proxy)],
        )
    };
    let columns = ["parameter", "through the ISP", "through the proxy"].map(Column::new);
    html! {
        (figure(&bars_svg(&chart)))
        (caption(html! {
            "The gradient of the mean squared error by the place of each parameter in its range, a tenth of it beside the parameters of the \
             training: at these the error is least and has no slope. Cosine between both: " (number::fixed(sheet.gradient_cosine, 2)) "."
            @if order.len() > MOST_BARS { " The " (MOST_BARS) " largest of " (order.len()) "." }
        }))
        details { summary { "All slopes" } (Table::new(columns).class("narrow").rows(order.iter().map(row)).html()) }
    }
}

/// Parameters in the chart.
const MOST_BARS: usize = 20;

/// The name of a parameter in words.
fn words(name: &str) -> String {
    name.replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet() -> Sheet {
        let slope = |parameter: &str, isp, proxy| Slope { parameter: parameter.into(), isp, proxy };
        Sheet {
            isp: "mine <1>".into(),
            frames: 27,
            psnr_db: [35.21, 33.0, 28.44],
            scores: vec![ScoreRow {
                title: "PSNR".into(),
                unit: "dB".into(),
                decimals: 2,
                isp: 30.25,
                proxy: 30.0,
            }],
            gradient_cosine: 0.8762,
            slopes: vec![slope("gamma", 0.3, 0.6), slope("tone_curve.mid", -0.4, -0.8)],
            pictures: vec![Pair { height: 2, width: 2, isp: vec![0.5; 12], proxy: vec![0.53; 12] }],
        }
    }

    #[test]
    fn gap_and_cosine_come_first_and_both_pictures_stand_side_by_side_with_their_difference() {
        let page = page(&sheet());
        crate::page::assert_readable(&page);
        let (front, rest) = page.split_once("<nav").unwrap();
        for text in [
            "27 frames",
            "35.2\u{a0}dB",
            "28.4\u{a0}dB",
            ">0.88<",
            "leads where that of the ISP leads (cosine 0.88)",
        ] {
            assert!(front.contains(text), "{text}: {front}");
        }
        let at = |text: &str| rest.find(text).unwrap_or_else(|| panic!("{text}"));
        assert!(
            at("ISP, frame 1") < at("proxy, frame 1") && at("proxy, frame 1") < at("difference, frame 1")
        );
        assert!(
            at("<h2>Side by side</h2>") < at("<h2>Gap</h2>") && at("<h2>Gap</h2>") < at("<h2>Gradients</h2>")
        );
        assert_eq!(page.matches("<img").count(), 3);
        assert!(
            rest.contains("\u{2212}0.25")
                && rest.contains("tone curve.mid")
                && page.contains("mine &lt;1&gt;")
        );
    }

    #[test]
    fn a_difference_of_3_percent_is_24_percent_above_middle_gray() {
        let shown = difference(&sheet().pictures[0]);
        assert_eq!(shown.get_pixel(0, 0), &Rgb([189, 189, 189]));
    }

    #[test]
    fn the_sentence_says_where_a_gradient_leads() {
        let said = |gradient_cosine| sentence(&Sheet { gradient_cosine, ..sheet() });
        assert!(
            said(0.5).contains("roughly")
                && said(0.0).contains("little to do")
                && said(-0.9).contains("leads away")
        );
    }
}
