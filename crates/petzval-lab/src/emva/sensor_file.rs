//! Writes the characterisation as a sensor file for the simulator.

use std::fmt::{self, Write};

use super::histogram_fit::HistogramFit;
use super::joint::{GainRow, JointFit};
use super::measured::{Measured, Unresolved};
use super::result::{ChannelResult, Characterization, GainResult};
use petzval_camera::sensor::Colour;

/// One line of the file.
struct Entry {
    key: &'static str,
    unit: &'static str,
    value: Measured,
    /// Value in the file if the number is not resolved, and its meaning.
    stand_in: f64,
    stand_in_is: &'static str,
}

/// The numbers of the model for the file. They come from the fit to the histograms if it was made and is valid, because its
/// simulated histograms match captured ones best; else from the joint fit.
struct Model<'a> {
    joint: &'a JointFit,
    fit: Option<&'a HistogramFit>,
}

impl<'a> Model<'a> {
    fn of(found: &'a Characterization) -> Self {
        Self { joint: &found.joint, fit: found.histogram_fit.as_ref().filter(|fit| fit.is_sound()) }
    }

    /// A number of the fit if it has an error (held parameters have none), else that of the joint fit.
    fn best(&self, fitted: fn(&HistogramFit) -> Measured, joint: Measured) -> Measured {
        self.fit.map(fitted).filter(|m| m.standard_error().is_some()).unwrap_or(joint)
    }

    fn gain(&self) -> Measured {
        self.best(|f| f.gain_dn_per_e, self.joint.gain_dn_per_e)
    }

    /// Dark current of the ordinary pixels; hot pixels have lines of their own.
    fn dark_current(&self) -> Measured {
        let joint = match self.joint.hot_pixel_share.value() {
            Some(_) => self.joint.dark_current_ordinary_e_per_s,
            None => self.joint.dark_current_e_per_s,
        };
        self.best(|f| f.dark_current_e_per_s, joint)
    }

    /// Dark noise of single pixels: without DSNU, and without the noise of rows and columns, which has lines of its own.
    fn read_noise(&self) -> Measured {
        let whole = match self.fit.and_then(|f| f.dsnu_e.value()) {
            Some(_) => self.joint.read_noise_e,
            None => self.best(|f| f.dark_noise_e, self.joint.read_noise_e),
        };
        without_lines(whole, self.joint)
    }

    /// BL + mu_el.
    fn dark_offset(&self) -> Measured {
        self.best(|f| f.dark_offset_dn, self.joint.dark_offset_dn)
    }

    /// mu_el, where BL is stated.
    fn electronics_mean(&self) -> Measured {
        match self.joint.black_level_dn {
            Some(black) => self.dark_offset().minus(Measured::exact(black)),
            None => self.joint.electronics_mean_dn,
        }
    }
}

/// A noise in electrons less that of rows and columns, where these are resolved.
fn without_lines(noise_e: Measured, joint: &JointFit) -> Measured {
    let lines = [joint.row_noise_e, joint.column_noise_e];
    let less = |noise: Measured, line: &Measured| match line.value() {
        Some(_) => noise.squared().minus(line.squared()).root(),
        None => noise,
    };
    lines.iter().fold(noise_e, less)
}

/// Text of a sensor file: numbers at linear gain 1 with their standard errors as comments. Where a number is not resolved, the
/// file holds a stand-in, and a comment gives the reason. K has no stand-in, because all numbers in electrons follow from it:
/// without K the reason is returned instead of a file.
pub fn sensor_toml(found: &Characterization) -> Result<String, Unresolved> {
    let (joint, model) = (&found.joint, Model::of(found));
    let gain = model.gain();
    let Some(k) = gain.value() else { return Err(gain.reason().unwrap_or(Unresolved::NotFinite)) };
    let max_dn = (2.0_f64).powi(found.sensor.bits as i32) - 1.0;
    // Choose the stand-ins. One gain separates neither read noise from electronics noise nor their means.
    let lowest = found.gains.first();
    let channel = lowest.and_then(|g| g.channels.first());
    let figure = |name: &str| channel.and_then(|c| c.figure(name)).map(|f| f.best());
    let single_gain = joint.read_noise_e.value().is_none();
    let dark_noise = figure("sigma_d").unwrap_or(Measured::none(Unresolved::FollowsFrom("K")));
    let dark_noise =
        if dark_noise.standard_error().is_some() { without_lines(dark_noise, joint) } else { dark_noise };
    let dark_mean = joint.rows.first().map_or(Measured::none(Unresolved::NoStack), |r| r.dark_mean_dn);
    let any_dark = lowest.and_then(|g| g.dark.points.first()).map_or(0.0, |p| p.mean_dn);
    let black_stand_in = dark_mean.value().unwrap_or(any_dark).clamp(0.0, max_dn);
    let offset = model.dark_offset().value();
    let black =
        joint.black_level_dn.map_or(Measured::none(Unresolved::NotStated("black_level_dn")), Measured::exact);
    let black_value = black.value().or(offset).unwrap_or(black_stand_in);
    let converter_e = (max_dn - black_value) / k;
    // Take the full well from the colour that reaches it, without pixels that do not answer light.
    let saturated = lowest.and_then(|g| g.saturated_channel());
    let capacity = saturated.and_then(|c| {
        c.without_defects("u_e_sat").or_else(|| c.figure("u_e_sat").map(|figure| figure.best()))
    });
    let full_well = match found.sensor.full_well_e {
        Some(stated) => Measured::exact(stated),
        None => capacity.or(figure("u_e_sat")).unwrap_or(Measured::none(Unresolved::NotSaturated)),
    };
    let full_well_unit = match saturated.map(|c| c.colour) {
        Some(Colour::Red) => "e-, of the red pixels",
        Some(Colour::Green) => "e-, of the green pixels",
        Some(Colour::Blue) => "e-, of the blue pixels",
        _ => "e-",
    };
    // List the numbers of the model with their stand-ins.
    let entry = |key, unit, value, stand_in, stand_in_is| Entry { key, unit, value, stand_in, stand_in_is };
    let read_noise_stand_in = match dark_noise.standard_error() {
        Some(_) => "the temporal dark noise at the lowest gain, without that of rows and columns",
        None => "an upper limit of the temporal dark noise at the lowest gain",
    };
    let mean_stand_in = match (joint.black_level_dn, offset) {
        (Some(black), None) => black_stand_in - black,
        _ => 0.0,
    };
    let dark_is = "the dark mean without dark current, electronics included";
    let read_noise_mean = model.best(|f| f.read_noise_mean_e, joint.read_noise_mean_e);
    let electronics_noise = model.best(|f| f.electronics_noise_dn, joint.electronics_noise_dn);
    let (counted, left) = (
        "none; any offset of the electronics counts as black level",
        "what the dark mean leaves of the black level",
    );
    let in_read_noise = if single_gain { "none; it is in the read noise" } else { "none" };
    let dark_noise = dark_noise.value().unwrap_or(0.0);
    let entries = [
        entry("black_level_dn", "DN", black, black_value, dark_is),
        entry("gain_dn_per_e", "DN/e-", gain, k, "none"),
        entry("full_well_e", full_well_unit, full_well, converter_e, "the range of the converter"),
        entry("dark_current_e_per_s", "e-/s", model.dark_current(), 0.0, "none"),
        entry("read_noise_mean_e", "e-", read_noise_mean, 0.0, counted),
        entry("read_noise_e", "e-", model.read_noise(), dark_noise, read_noise_stand_in),
        entry("electronics_mean_dn", "DN", model.electronics_mean(), mean_stand_in, left),
        entry("electronics_noise_dn", "DN", electronics_noise, 0.0, in_read_noise),
    ];

    let mut text = String::new();
    write_sensor(found, &entries, offset, &mut text).expect("a string takes whatever is written");
    Ok(text)
}

/// Writes the facts of the sensor, the numbers, the colours, the gains and the non-uniformity. `offset` is BL + mu_el, DN.
fn write_sensor(
    found: &Characterization,
    entries: &[Entry],
    offset: Option<f64>,
    text: &mut String,
) -> fmt::Result {
    let (joint, model) = (&found.joint, Model::of(found));
    let quoted = |s: &str| toml::Value::String(s.to_owned()).to_string();
    writeln!(text, "# Measured by `petzval sensor characterize`; all numbers hold at linear gain 1.")?;
    if model.fit.is_some() {
        writeln!(text, "# The model is that of the fit to the histograms, as far as they determine it.")?;
    }
    writeln!(text, "name = {}", quoted(&found.sensor.name))?;
    writeln!(text, "source = \"characterised from captures after EMVA 1288\"\n")?;
    writeln!(text, "height = {}\nwidth = {}", found.height, found.width)?;
    match found.sensor.pixel_um {
        Some(pitch) => writeln!(text, "pixel_um = {pitch:?}")?,
        None => writeln!(text, "pixel_um = 1.0   # not resolved: the captures do not state the pixel pitch")?,
    }
    writeln!(text, "bits = {}\n", found.sensor.bits)?;
    if joint.rows.iter().any(|row| row.black_shift_dn != 0.0) {
        let of_row = |row: &GainRow| {
            format!("{:?}", joint.black_level_dn.or(offset).unwrap_or(0.0) + row.black_shift_dn)
        };
        let levels: Vec<String> = joint.rows.iter().map(of_row).collect();
        let levels = levels.join(", ");
        writeln!(text, "# Black levels of the gains, as stated: {levels} DN; that of the lowest:")?;
    }
    for e in entries {
        match (e.value.value(), e.value.standard_error(), e.value.reason()) {
            (Some(v), Some(se), _) => writeln!(text, "{} = {v:?}   # +- {se:.2e} {}", e.key, e.unit)?,
            (_, _, Some(why)) => {
                writeln!(text, "# {}: not resolved: {why}; the stand-in is {}", e.key, e.stand_in_is)?;
                writeln!(text, "{} = {:?}", e.key, e.stand_in)?;
            }
            (v, ..) => writeln!(text, "{} = {:?}   # {}, as stated", e.key, v.unwrap_or(e.stand_in), e.unit)?,
        }
    }
    writeln!(text, "electronics = \"before_adc\"   # assumed: captures look the same with after_adc\n")?;
    let ratio = |m: Measured| m.value().unwrap_or(1.0);
    let red = model.best(|f| f.red_over_green, joint.red_over_green);
    let blue = model.best(|f| f.blue_over_green, joint.blue_over_green);
    if let Some(why) = red.reason().or(blue.reason()) {
        writeln!(text, "# relative_qe: red and blue not resolved: {why}; the stand-in is 1")?;
    }
    let (red, blue) = (ratio(red), ratio(blue));
    writeln!(text, "relative_qe = [{red:?}, 1.0, {blue:?}]   # in the light of the captures")?;
    writeln!(text, "cfa = {}", quoted(&found.sensor.cfa.to_string()))?;
    let gains: Vec<String> = found.gains.iter().map(|g| format!("{:?}", g.linear_gain)).collect();
    if gains.len() > 1 {
        writeln!(text, "gain_steps = [{}]", gains.join(", "))?;
    }
    non_uniformity(found, text)
}

/// Appends the non-uniformity: hot pixels, and DSNU and PRNU of the lowest gain that has stacks, mean of the colours.
fn non_uniformity(found: &Characterization, text: &mut String) -> fmt::Result {
    let joint = &found.joint;
    let stacks = found.gains.iter().find(|g| g.channels.iter().any(|c| c.spatial.is_some()));
    let hot = joint.hot_pixel_share.value().is_some();
    let fit = Model::of(found).fit.filter(|f| f.dark_noise_e.standard_error().is_some());
    writeln!(text)?;
    let lines = [("row_noise_e", joint.row_noise_e), ("column_noise_e", joint.column_noise_e)];
    let has_lines = lines.iter().any(|(_, noise)| noise.value().is_some());
    if stacks.is_some() || hot || fit.is_some() || has_lines {
        writeln!(text, "[nonuniformity]")?;
    }
    match stacks {
        None if fit.is_some() => {
            for (key, of, unit) in [
                ("dsnu_pixel_e", (|f| f.dsnu_e) as fn(&HistogramFit) -> Measured, "e-, by the histograms"),
                ("prnu_pixel_percent", |f| f.prnu_percent, "%, by the histograms"),
            ] {
                line(text, key, fit.map_or(Measured::none(Unresolved::NoStack), of), unit)?;
            }
        }
        None => writeln!(text, "# DSNU, PRNU: not resolved: {}", Unresolved::NoStack)?,
        Some(gain) => stack_non_uniformity(hot, gain, text)?,
    }
    for (key, noise) in lines {
        line(text, key, noise, "e-, from frame to frame")?;
    }
    if let (true, Some(mean)) = (hot, joint.dark_current_e_per_s.value()) {
        writeln!(
            text,
            "# dark_current_e_per_s is that of the pixels that are not hot; the mean of all is {mean:?} e-/s"
        )?;
    }
    line(text, "hot_pixel_share", joint.hot_pixel_share, "")?;
    line(text, "hot_pixel_e_per_s", joint.hot_pixel_e_per_s, "e-/s")
}

/// DSNU and PRNU of one gain. Hot pixels have lines of their own, so the DSNU is that of the other pixels.
fn stack_non_uniformity(has_hot: bool, gain: &GainResult, text: &mut String) -> fmt::Result {
    for (key, name, unit) in [
        ("dsnu_pixel_e", "DSNU1288_pixel", "e-"),
        ("dsnu_row_e", "DSNU1288_row", "e-"),
        ("dsnu_column_e", "DSNU1288_col", "e-"),
        ("prnu_pixel_percent", "PRNU1288_pixel", "%"),
        ("prnu_row_percent", "PRNU1288_row", "%"),
        ("prnu_column_percent", "PRNU1288_col", "%"),
    ] {
        let of_channel = |c: &ChannelResult| {
            let not_hot = c.spatial.as_ref()?.dark_components_without_hot.filter(|_| has_hot);
            let in_electrons = |part: Measured| part.if_above_noise().root().over(c.transfer.gain_dn_per_e);
            match (key, not_hot) {
                ("dsnu_pixel_e", Some(parts)) => Some(in_electrons(parts.pixel)),
                ("dsnu_row_e", Some(parts)) => Some(in_electrons(parts.row)),
                ("dsnu_column_e", Some(parts)) => Some(in_electrons(parts.column)),
                _ => c.figure(name).map(|f| f.best()),
            }
        };
        let all: Vec<Measured> = gain.channels.iter().filter_map(of_channel).collect();
        let known: Vec<f64> = all.iter().filter_map(Measured::value).collect();
        let count = known.len() as f64;
        let measured = if known.is_empty() {
            all.first().copied().unwrap_or(Measured::none(Unresolved::NoStack))
        } else {
            let se = all.iter().filter_map(Measured::standard_error).map(|s| s * s).sum::<f64>().sqrt();
            Measured::new(known.iter().sum::<f64>() / count, se / count)
        };
        line(text, key, measured, unit)?;
    }
    let bright: usize = gain.channels.iter().filter_map(|c| c.spatial.as_ref()).map(|s| s.bright).sum();
    if bright > 0 {
        let without = |c: &ChannelResult| {
            let parts = c.spatial.as_ref()?.dark_components_without_bright?;
            parts.pixel.if_above_noise().root().over(c.transfer.gain_dn_per_e).value()
        };
        let known: Vec<f64> = gain.channels.iter().filter_map(without).collect();
        let dsnu_e = known.iter().sum::<f64>() / known.len() as f64;
        let of_others = if known.is_empty() {
            String::new()
        } else {
            format!("; without them dsnu_pixel_e = {dsnu_e:.4}")
        };
        writeln!(text, "# pixels that are bright in the dark at every exposure time: {bright}{of_others}")?;
    }
    let defects: usize =
        gain.channels.iter().filter_map(|c| c.spatial.as_ref()).map(|s| s.defects.len()).sum();
    if defects > 0 {
        let pixels = if defects == 1 { "1 pixel that does" } else { &format!("{defects} pixels that do") };
        writeln!(text, "# {pixels} not answer light: left out of DSNU and PRNU; results.json lists them")?;
    }
    Ok(())
}

/// One line: a number with its standard error, or a comment that says why there is none.
fn line(text: &mut String, key: &str, measured: Measured, unit: &str) -> fmt::Result {
    match (measured.value(), measured.standard_error(), measured.reason()) {
        (Some(v), Some(se), _) => {
            let comment = format!("+- {se:.2e} {unit}");
            writeln!(text, "{key} = {v:?}   # {}", comment.trim_end())
        }
        (Some(v), None, _) => writeln!(text, "{key} = {v:?}"),
        (None, _, why) => {
            let why = why.map_or(String::new(), |why| why.to_string());
            writeln!(text, "# {key}: not resolved: {why}")
        }
    }
}
