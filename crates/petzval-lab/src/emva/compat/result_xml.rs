//! Results as XML under the computer names of the EMVA 1288 Python library, grouped by its sections.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::emva::figures::Limit;
use crate::emva::high_pass::HighPass;
use crate::emva::histogram::Histogram;
use crate::emva::measured::Measured;
use crate::emva::result::ChannelResult;

/// Which of the two values of a figure to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Values {
    /// Values as the library derives them, for comparison with it.
    Library,
    /// Our values where they differ.
    Corrected,
}

/// XML of one colour at one gain: `results/SECTION/NAME/{short, unit, value}`, histograms as `data/{bins, values, model}`.
/// Unresolved figures have the value `None`, as in the library.
pub fn result_xml(channel: &ChannelResult, values: Values) -> Result<String, std::io::Error> {
    let mut out = Writer::new_with_indent(Vec::new(), b' ', 2);
    out.write_event(Event::Decl(BytesDecl::new("1.0", Some("utf-8"), None)))?;
    out.write_event(Event::Start(BytesStart::new("results")))?;
    let mut sections: Vec<&str> = channel.figures.iter().map(|f| f.section).collect();
    sections.push("defect_pixel");
    sections.sort_unstable();
    sections.dedup();
    for section in sections {
        out.write_event(Event::Start(BytesStart::new(section)))?;
        for figure in channel.figures.iter().filter(|f| f.section == section) {
            let value = if values == Values::Library { figure.value } else { figure.best() };
            out.write_event(Event::Start(BytesStart::new(figure.name)))?;
            text(&mut out, "short", figure.meaning)?;
            if !figure.unit.is_empty() {
                text(&mut out, "unit", figure.unit)?;
            }
            text(&mut out, "value", &number(value))?;
            if let Some(se) = value.standard_error() {
                text(&mut out, "standard_error", &format!("{se:?}"))?;
            }
            if let Some(limit) = figure.limit {
                text(&mut out, "limit", if limit == Limit::Upper { "upper" } else { "lower" })?;
            }
            if let Some(why) = value.reason() {
                text(&mut out, "not_resolved", &why.to_string())?;
            }
            out.write_event(Event::End(BytesEnd::new(figure.name)))?;
        }
        if let (true, Some(spatial)) = (section == "defect_pixel", &channel.spatial) {
            histogram(&mut out, "histogram_DSNU", &spatial.dsnu.histogram)?;
            histogram(&mut out, "histogram_DSNU_accumulated", &spatial.dsnu.accumulated)?;
            histogram(&mut out, "histogram_PRNU", &spatial.prnu.histogram)?;
            histogram(&mut out, "histogram_PRNU_accumulated", &spatial.prnu.accumulated)?;
        }
        out.write_event(Event::End(BytesEnd::new(section)))?;
    }
    out.write_event(Event::End(BytesEnd::new("results")))?;
    // The writer gives valid UTF-8.
    Ok(String::from_utf8_lossy(&out.into_inner()).into_owned() + "\n")
}

fn number(value: Measured) -> String {
    value.value().map_or("None".to_owned(), |v| format!("{v:?}"))
}

fn text(out: &mut Writer<Vec<u8>>, name: &str, content: &str) -> Result<(), std::io::Error> {
    out.write_event(Event::Start(BytesStart::new(name)))?;
    out.write_event(Event::Text(BytesText::new(content)))?;
    out.write_event(Event::End(BytesEnd::new(name)))
}

fn histogram(out: &mut Writer<Vec<u8>>, name: &str, found: &Histogram) -> Result<(), std::io::Error> {
    let list = |v: &[f64]| v.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(" ");
    out.write_event(Event::Start(BytesStart::new(name)))?;
    out.write_event(Event::Start(BytesStart::new("data")))?;
    text(out, "bins", &list(&found.bins))?;
    text(out, "values", &list(&found.values))?;
    text(out, "model", &list(&found.model))?;
    out.write_event(Event::End(BytesEnd::new("data")))?;
    out.write_event(Event::End(BytesEnd::new(name)))
}

impl HighPass {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::R31 => "r3.1",
            Self::R4 => "r4",
        }
    }
}
