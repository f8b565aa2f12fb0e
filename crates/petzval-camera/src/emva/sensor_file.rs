//! The characterisation as a sensor file that the simulator loads.

use std::fmt::Write;

use super::characterize::{Characterization, GainResult};
use super::joint::JointFit;
use super::measured::{Measured, Unresolved};
use crate::sensor::Colour;

/// One line of the file.
struct Entry {
    key: &'static str,
    unit: &'static str,
    value: Measured,
    /// What the file holds where the captures do not tell, and in which words that is said.
    stand_in: f64,
    stand_in_is: &'static str,
}

/// Text of a sensor file: numbers at linear gain 1 with their standard errors as comments. Where the captures do not tell a
/// number, the file holds a stand-in and says so.
pub fn sensor_toml(found: &Characterization) -> String {
    let joint = &found.joint;
    let max_dn = (2.0_f64).powi(found.sensor.bits as i32) - 1.0;
    // With one gain, read noise and electronics noise are one number, and so are their means.
    let lowest = found.gains.first();
    let channel = lowest.and_then(|g| g.channels.first());
    let figure = |name: &str| channel.and_then(|c| c.figure(name)).map(|f| f.best());
    let single_gain = joint.read_noise_e.value().is_none();
    let dark_noise = figure("sigma_d").unwrap_or(Measured::none(Unresolved::FollowsFrom("K")));
    let gain = joint.gain_dn_per_e;
    let dark_mean = joint.rows.first().map_or(Measured::none(Unresolved::NoStack), |r| r.dark_mean_dn);
    let any_dark = lowest.and_then(|g| g.dark.points.first()).map_or(0.0, |p| p.mean_dn);
    let black_stand_in = dark_mean.value().unwrap_or(any_dark).clamp(0.0, max_dn);
    let black = match (joint.black_level_dn, joint.dark_offset_dn.value()) {
        (Some(black), _) => Measured::exact(black),
        (None, Some(_)) => Measured::none(Unresolved::NotStated("black_level_dn")),
        (None, None) => Measured::none(Unresolved::NotStated("black_level_dn")),
    };
    let black_value = black.value().unwrap_or(joint.dark_offset_dn.value().unwrap_or(black_stand_in));
    let converter_e = gain.value().map_or(1e5, |k| (max_dn - black_value) / k);
    let full_well = match found.sensor.full_well_e {
        Some(stated) => Measured::exact(stated),
        None => figure("u_e_sat").unwrap_or(Measured::none(Unresolved::NotSaturated)),
    };
    // Hot pixels have lines of their own: the others have the sensor's dark current.
    let dark_current = match joint.hot_pixel_share.value() {
        Some(_) => joint.dark_current_ordinary_e_per_s.if_above_noise(),
        None => joint.dark_current_e_per_s,
    };
    let entries = [
        Entry {
            key: "black_level_dn",
            unit: "DN",
            value: black,
            stand_in: black_value,
            stand_in_is: "the dark mean without dark current, electronics included",
        },
        Entry {
            key: "gain_dn_per_e",
            unit: "DN/e-",
            value: gain,
            stand_in: 1.0,
            stand_in_is: "one digital number per electron",
        },
        Entry {
            key: "full_well_e",
            unit: "e-",
            value: full_well,
            stand_in: converter_e,
            stand_in_is: "the range of the converter",
        },
        Entry {
            key: "dark_current_e_per_s",
            unit: "e-/s",
            value: dark_current,
            stand_in: 0.0,
            stand_in_is: "none",
        },
        Entry {
            key: "read_noise_mean_e",
            unit: "e-",
            value: joint.read_noise_mean_e,
            stand_in: 0.0,
            stand_in_is: "none; what there is counts as black level",
        },
        Entry {
            key: "read_noise_e",
            unit: "e-",
            value: joint.read_noise_e,
            stand_in: dark_noise.value().unwrap_or(0.0),
            stand_in_is: "all of the temporal dark noise at the lowest gain",
        },
        Entry {
            key: "electronics_mean_dn",
            unit: "DN",
            value: joint.electronics_mean_dn,
            stand_in: match (joint.black_level_dn, joint.dark_offset_dn.value()) {
                (Some(black), None) => black_stand_in - black,
                _ => 0.0,
            },
            stand_in_is: "what the dark mean leaves of the black level",
        },
        Entry {
            key: "electronics_noise_dn",
            unit: "DN",
            value: joint.electronics_noise_dn,
            stand_in: 0.0,
            stand_in_is: if single_gain { "none; it is in the read noise" } else { "none" },
        },
    ];

    let mut text = String::new();
    let quoted = |s: &str| toml::Value::String(s.to_owned()).to_string();
    // Writing to a text cannot fail.
    let _ = writeln!(text, "# Measured by `petzval sensor characterize`; all numbers hold at linear gain 1.");
    let _ = writeln!(text, "name = {}", quoted(&found.sensor.name));
    let _ = writeln!(text, "source = \"characterised from captures after EMVA 1288\"\n");
    let _ = writeln!(text, "height = {}\nwidth = {}", found.height, found.width);
    match found.sensor.pixel_um {
        Some(pitch) => {
            let _ = writeln!(text, "pixel_um = {pitch:?}");
        }
        None => {
            let _ =
                writeln!(text, "pixel_um = 1.0   # not resolved: the captures do not state the pixel pitch");
        }
    }
    let _ = writeln!(text, "bits = {}\n", found.sensor.bits);
    for e in &entries {
        match (e.value.value(), e.value.standard_error(), e.value.reason()) {
            (Some(v), Some(se), _) => {
                let _ = writeln!(text, "{} = {v:?}   # +- {se:.2e} {}", e.key, e.unit);
            }
            (_, _, Some(why)) => {
                let _ = writeln!(text, "# {}: not resolved: {why}; the stand-in is {}", e.key, e.stand_in_is);
                let _ = writeln!(text, "{} = {:?}", e.key, e.stand_in);
            }
            (v, ..) => {
                let _ = writeln!(text, "{} = {:?}   # {}, as stated", e.key, v.unwrap_or(e.stand_in), e.unit);
            }
        }
    }
    let _ = writeln!(text, "electronics = \"before_adc\"\n");
    let ratio = |m: Measured| m.value().unwrap_or(1.0);
    let (red, blue) = (joint.red_over_green, joint.blue_over_green);
    if let Some(why) = red.reason().or(blue.reason()) {
        let _ = writeln!(text, "# relative_qe: red and blue not resolved: {why}; the stand-in is 1");
    }
    let _ = writeln!(
        text,
        "relative_qe = [{:?}, 1.0, {:?}]   # in the light of the captures",
        ratio(red),
        ratio(blue)
    );
    let _ = writeln!(text, "cfa = {}", quoted(&found.sensor.cfa.to_string()));
    let gains: Vec<String> = found.gains.iter().map(|g| format!("{:?}", g.linear_gain)).collect();
    if gains.len() > 1 {
        let _ = writeln!(text, "gain_steps = [{}]", gains.join(", "));
    }
    non_uniformity(found, &mut text);
    text
}

/// Appends what is known of the non-uniformity: hot pixels, and DSNU and PRNU of the lowest gain that has stacks, mean of the
/// colours.
fn non_uniformity(found: &Characterization, text: &mut String) {
    let joint = &found.joint;
    let stacks = found.gains.iter().find(|g| g.channels.iter().any(|c| c.spatial.is_some()));
    let hot = joint.hot_pixel_share.value().is_some();
    let _ = writeln!(text);
    if stacks.is_some() || hot {
        let _ = writeln!(text, "[nonuniformity]");
    }
    match stacks {
        None => {
            let _ = writeln!(text, "# DSNU, PRNU: not resolved: {}", Unresolved::NoStack);
        }
        Some(gain) => stack_non_uniformity(joint, gain, text),
    }
    if let (true, Some(mean)) = (hot, joint.dark_current_e_per_s.value()) {
        let _ = writeln!(
            text,
            "# dark_current_e_per_s is that of the pixels that are not hot; the mean of all is {mean:?} e-/s"
        );
    }
    line(text, "hot_pixel_share", joint.hot_pixel_share, "");
    line(text, "hot_pixel_e_per_s", joint.hot_pixel_e_per_s, "e-/s");
}

/// DSNU and PRNU of one gain. What hot pixels add to the variance of the dark stack has lines of its own, and goes from the DSNU of
/// single pixels.
fn stack_non_uniformity(joint: &JointFit, gain: &GainResult, text: &mut String) {
    for (key, name, unit) in [
        ("dsnu_pixel_e", "DSNU1288_pixel", "e-"),
        ("dsnu_row_e", "DSNU1288_row", "e-"),
        ("dsnu_column_e", "DSNU1288_col", "e-"),
        ("prnu_pixel_percent", "PRNU1288_pixel", "%"),
        ("prnu_row_percent", "PRNU1288_row", "%"),
        ("prnu_column_percent", "PRNU1288_col", "%"),
    ] {
        let all: Vec<Measured> =
            gain.channels.iter().filter_map(|c| c.figure(name)).map(|f| f.best()).collect();
        let known: Vec<f64> = all.iter().filter_map(Measured::value).collect();
        let count = known.len() as f64;
        let mut measured = match known.is_empty() {
            true => all.first().copied().unwrap_or(Measured::none(Unresolved::NoStack)),
            false => {
                let se = all.iter().filter_map(Measured::standard_error).map(|s| s * s).sum::<f64>().sqrt();
                Measured::new(known.iter().sum::<f64>() / count, se / count)
            }
        };
        let exposure_s = gain.channels.iter().find_map(|c| c.spatial.as_ref()).map(|s| s.exposure_s);
        if let ("dsnu_pixel_e", Some(hot), Some(t)) =
            (key, joint.hot_pixel_variance_e2_per_s2.value(), exposure_s)
        {
            let squared = measured.map(|v| v * v - hot * t * t, |v| 2.0 * v);
            measured = squared.if_above_noise().root();
        }
        line(text, key, measured, unit);
    }
}

/// One line: a number with its standard error, or a comment that says why there is none.
fn line(text: &mut String, key: &str, measured: Measured, unit: &str) {
    let _ = match (measured.value(), measured.standard_error(), measured.reason()) {
        (Some(v), Some(se), _) => {
            let comment = format!("+- {se:.2e} {unit}");
            writeln!(text, "{key} = {v:?}   # {}", comment.trim_end())
        }
        (Some(v), None, _) => writeln!(text, "{key} = {v:?}"),
        (None, _, why) => {
            let why = why.map_or(String::new(), |why| why.to_string());
            writeln!(text, "# {key}: not resolved: {why}")
        }
    };
}

/// Colours by name for headings and files: the letter of the pattern, `mono` for a sensor without filters.
pub fn colour_name(colour: Colour) -> &'static str {
    match colour {
        Colour::Clear => "mono",
        filtered => filtered.name(),
    }
}
