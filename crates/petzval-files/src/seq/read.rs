//! Reads a file: first all commands, then the lens that they define.

use super::command::{Command, Commands, Word, surface_name};
use super::glass::PrivateGlasses;
use super::read_surface::{RawSurface, is_surface_command};
use super::system::System;
use crate::ForeignRecords;
use crate::decimal::shown;
use crate::draft::{Aperture, Break, Draft, Import, Item, MOST_SURFACES, Record, check_size};
use crate::loss::{Effect, Losses};
use petzval_base::FileError;
use petzval_optics::glass::Catalog;

/// Commands without effect on the lens: start and end of the program, display, apertures in drawings.
const BOOKKEEPING: &[&str] = &["LEN", "GO", "INI", "CWL", "CA"];

/// Codes of variables: 0 marks the number of a surface as one.
const VARIABLE_CODES: &[&str] = &[
    "CCY", "CCX", "THC", "GLC", "KC", "AC", "BC", "CC", "DC", "EC", "FC", "GC", "HC", "JC", "CUC", "SCC",
    "XDC", "YDC", "ZDC", "ADC", "BDC", "CDC",
];

/// Commands whose effect on light is not traced.
const REFUSED: &[(&[&str], &str)] = &[
    (&["DIF"], "diffractive structures are not read: the sign of their orders is not known"),
    (&["GRT"], "gratings are not read: the sign of their orders is not known"),
    (&["HOE"], "holograms are not traced"),
    (&["XTO"], "toroids whose section in x is turned are not traced"),
    (&["SPL"], "splines are not traced"),
    (&["UDS"], "user-defined surfaces are not traced"),
    (&["UDG", "GRI"], "gradient-index media are not traced"),
    (&["ARR"], "arrays of surfaces are not traced"),
    (&["NSS", "ENS"], "non-sequential ranges are not traced"),
    (&["MOD", "LMO"], "lens modules are not traced"),
    (&["RET"], "returns to an earlier surface are not read"),
    (&["GLB"], "positions against an earlier surface are not read"),
    (&["FRZ"], "Fresnel surfaces are not traced"),
    (
        &["HCO", "HCT", "HWL", "HOR", "HTO", "HX1", "HY1", "HZ1", "HX2", "HY2", "HZ2", "HV1", "HV2"],
        "holograms are not traced",
    ),
    (&["ZRN"], "Zernike surfaces are not traced"),
    (&["INT"], "measured and computed deformations of surfaces are not traced"),
    (&["BIR"], "birefringent media are not traced"),
    (&["RED"], "a magnification from which the program finds the object is not read"),
    (
        &["SCA", "DEL", "INS", "COP", "FLP", "INV"],
        "commands that change the lens afterwards are not read; write the resulting lens",
    ),
];

/// The commands that are not read into the lens.
pub fn records() -> ForeignRecords {
    ForeignRecords {
        ignored: [BOOKKEEPING, VARIABLE_CODES].concat(),
        lost: Vec::new(),
        solves: Vec::new(),
        refused: REFUSED.iter().flat_map(|(names, why)| names.iter().map(|name| (*name, *why))).collect(),
    }
}

/// Reads a lens file. Glasses are looked up in the file's private catalogue, then in `catalog`, by their exact name or by
/// the program's spelling, such as `NBK7_SCHOTT`.
///
/// Errors name the first command that cannot be traced as it stands, with its line.
pub fn parse_seq(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    parse_seq_start(text, catalog)?.buildable()
}

/// Reads a lens file to start an optimisation from: [`Import::unbuildable`] says whether its glass is too thin or its surfaces cross.
pub fn parse_seq_start(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    check_size(text)?;
    let mut reader = Reader::default();
    for command in Commands::new(text) {
        reader.read(&command?)?;
    }
    reader.finish(catalog)
}

/// The commands that have been read so far.
#[derive(Default)]
struct Reader {
    system: System,
    losses: Losses,
    private: PrivateGlasses,
    in_private: bool,
    /// Whether surfaces have radii, if `RDM` was read; the program's default is curvatures.
    radius_mode: Option<bool>,
    /// Surfaces from the object to the image.
    surfaces: Vec<RawSurface>,
    has_image: bool,
    /// The surface to which commands without a surface refer.
    current: usize,
    stop: Option<(usize, Record)>,
    paraxial_image: Option<Record>,
    /// The pickups, `None` where one is not understood, with their commands.
    pickups: Vec<(Option<Pickup>, Record)>,
}

/// Message of a zoomed command.
const FIRST_POSITION: &str = "only the first zoom position is read";

/// A number of a surface that is `factor` times that of another plus `summand`, in the units of the file.
struct Pickup {
    /// The command that sets the number.
    quantity: String,
    to: usize,
    from: usize,
    factor: f64,
    summand: f64,
}

impl Pickup {
    /// The number that it gives and the one that the file states; `None` if the quantity is not one of those that are read.
    fn values(&self, surfaces: &[RawSurface], radii: bool) -> Option<[f64; 2]> {
        let value = |surface: usize| surfaces.get(surface)?.value(&self.quantity, radii);
        Some([self.factor * value(self.from)? + self.summand, value(self.to)?])
    }
}

/// Whether two numbers of a file differ by no more than their printed digits; infinite radii are the same.
fn is_same(a: f64, b: f64) -> bool {
    const PRINTED: f64 = 1e-6;
    let largest = a.abs().max(b.abs());
    (a.is_infinite() && b.is_infinite()) || (a - b).abs() <= PRINTED * largest
}

impl Reader {
    fn lose(&mut self, record: &Record, effect: Effect, message: &str) {
        record.lose(&mut self.losses, effect, message);
    }

    fn read(&mut self, command: &Command) -> Result<(), FileError> {
        if self.in_private && (command.full != "END" || command.quoted) {
            return self.private.read(command);
        }
        if command.quoted {
            self.lose(&command.record, Effect::NotUnderstood, "this is not a command: it is in quotes");
            return Ok(());
        }
        if self.is_surface(command) {
            return self.add_surface(command);
        }
        if self.system.read(command, &mut self.losses)? {
            return Ok(());
        }
        match command.name.as_str() {
            "PRV" => self.in_private = true,
            "END" => self.in_private = false,
            "RDM" => self.radius_mode = Some(command.says_yes()?),
            "STO" => {
                let (surface, _) = self.target(command)?;
                if let Some((earlier, record)) = &self.stop
                    && *earlier != surface
                    && !command.zoomed
                {
                    let message = format!("line {} already makes another surface the stop", record.line);
                    return Err(command.error(message));
                }
                self.stop = Some((surface, command.record.clone()));
            }
            "PIM" => {
                self.paraxial_image = Some(command.record.clone());
                self.lose(&command.record, Effect::NoRay, "the solve is not kept, but its value is");
            }
            "ZOO" => self.read_zoomed(command)?,
            "PIK" => self.pickups.push((self.pickup(command), command.record.clone())),
            // The default, which the program writes with aspheres.
            "IC" if command.says_yes().is_ok_and(|yes| yes) => {}
            name if BOOKKEEPING.contains(&name) => {}
            name if VARIABLE_CODES.contains(&name) => {
                let code = command.words.last().and_then(|word| word.text.parse::<f64>().ok());
                if code == Some(0.0) {
                    let Record { line, text } = &command.record;
                    self.losses.add_part(
                        *line,
                        text,
                        "variables are not read: the file gives them no bounds",
                    );
                }
            }
            name if is_surface_command(name) => {
                let (surface, words) = self.target(command)?;
                let raw = &mut self.surfaces[surface];
                raw.read(command, words, &mut self.losses)?;
            }
            name => {
                if let Some((_, message)) = REFUSED.iter().find(|(refused, _)| refused.contains(&name)) {
                    return Err(command.error(*message));
                }
                // `S1.5 -5 1`: without it the lens is another one.
                let numeric = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.');
                if name.strip_prefix('S').unwrap_or(name).starts_with(numeric) {
                    let message = "this command is not understood, and may be a surface";
                    return Err(command
                        .error(message)
                        .hint("a surface is `S RADIUS THICKNESS [GLASS]`, with spaces"));
                }
                self.lose(&command.record, Effect::NotUnderstood, "this command is not understood");
            }
        }
        Ok(())
    }

    /// Reads the first position of a zoomed command as if it stood alone; it overrides what the file states before. `ZOO 3` is the number of
    /// positions.
    fn read_zoomed(&mut self, command: &Command) -> Result<(), FileError> {
        const NEVER_ZOOMED: &[&str] = &["ZOO", "PIK", "PIM", "PRV", "END", "RDM"];
        let quantity = command.word(0).unwrap_or("").to_uppercase();
        if quantity.is_empty() || quantity.parse::<f64>().is_ok() {
            self.lose(&command.record, Effect::NoRay, FIRST_POSITION);
            return Ok(());
        }
        let is_read =
            |first: &Command| !NEVER_ZOOMED.contains(&first.name.as_str()) && !self.is_surface(first);
        let Some(first) = command.first_position().filter(is_read) else {
            let message = format!("{quantity} of the first zoom position is not read");
            self.lose(&command.record, Effect::NotUnderstood, &message);
            return Ok(());
        };
        self.lose(&command.record, Effect::NoRay, FIRST_POSITION);
        self.read(&first)
    }

    /// The pickup of `PIK name [surface] surface [factor [summand]]`: the first surface takes its number from the second. `None` if the command
    /// has another form.
    fn pickup(&self, command: &Command) -> Option<Pickup> {
        let quantity = command.word(0)?.to_uppercase().chars().take(3).collect();
        let is_surface = |word: &&Word| !word.quoted && surface_name(&word.text.to_uppercase()).is_some();
        let named: Vec<&Word> = command.words.iter().skip(1).take_while(is_surface).collect();
        let surface = |word: &Word| self.numbered(surface_name(&word.text.to_uppercase())?);
        let (to, from) = match named[..] {
            [from] => (self.current, surface(from)?),
            [to, from] => (surface(to)?, surface(from)?),
            _ => return None,
        };
        let rest = command.words.get(1 + named.len()..)?;
        let numbers = rest.iter().map(|word| word.text.parse().ok()).collect::<Option<Vec<f64>>>()?;
        let (factor, summand) = match numbers[..] {
            [] => (1.0, 0.0),
            [factor] => (factor, 0.0),
            [factor, summand] => (factor, summand),
            _ => return None,
        };
        Some(Pickup { quantity, to, from, factor, summand })
    }

    /// Reports every pickup, and whether the numbers of the file fulfil it.
    fn report_pickups(&mut self, radii: bool) {
        for (pickup, record) in std::mem::take(&mut self.pickups) {
            let values = pickup.as_ref().and_then(|pickup| pickup.values(&self.surfaces, radii));
            let (effect, message) = match values {
                None => (
                    Effect::NotUnderstood,
                    "the pickup is not kept, and its value is not compared with that of the file".to_owned(),
                ),
                Some([picked, stated]) if is_same(picked, stated) => {
                    (Effect::NoRay, "the pickup is not kept, but its value is".to_owned())
                }
                Some([picked, stated]) => {
                    let (picked, stated) = (shown(picked), shown(stated));
                    let message = format!(
                        "the pickup is not kept: it gives {picked}, and the file states {stated}, which is taken"
                    );
                    (Effect::Unsolved, message)
                }
            };
            self.lose(&record, effect, &message);
        }
    }

    /// Whether a command adds a surface: `SO`, `S`, `S12`, `SI`, with at least a radius and a thickness.
    fn is_surface(&self, command: &Command) -> bool {
        let numbered = command.name.strip_prefix('S').is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()));
        numbered || matches!(command.name.as_str(), "SO" | "SI")
    }

    fn add_surface(&mut self, command: &Command) -> Result<(), FileError> {
        let is_object = command.name == "SO" || command.name == "S0";
        if is_object != self.surfaces.is_empty() {
            let message =
                if is_object { "the object is already defined" } else { "the object, SO, comes first" };
            return Err(command.error(message));
        }
        if self.has_image {
            return Err(command.error("no surface can follow the image"));
        }
        if self.surfaces.len() > MOST_SURFACES {
            return Err(command.error(format!("a lens with more than {MOST_SURFACES} surfaces is not read")));
        }
        if let Some(number) = command.name[1..].parse::<usize>().ok().filter(|n| *n != self.surfaces.len()) {
            let message = format!("surface {number} is not the next one, which is {}", self.surfaces.len());
            return Err(command.error(message));
        }
        self.has_image = command.name == "SI";
        self.current = self.surfaces.len();
        self.surfaces.push(RawSurface::new(command)?);
        Ok(())
    }

    /// The surface to which a command refers, and the command's values. A first word `S3`, `SO`, `SI` or `SS` names a surface;
    /// without it the current surface is meant.
    fn target<'c>(&self, command: &'c Command) -> Result<(usize, &'c [Word]), FileError> {
        if self.surfaces.is_empty() {
            return Err(command.error("this refers to a surface, and there is none yet"));
        }
        let named = command.words.first().filter(|word| !word.quoted).map(|word| word.text.to_uppercase());
        let Some(of) = named.as_deref().and_then(surface_name) else {
            return Ok((self.current, &command.words));
        };
        match self.numbered(of) {
            Some(surface) => Ok((surface, &command.words[1..])),
            None => Err(command
                .error(format!("there is no surface S{of}"))
                .hint("one surface at a time is read, from S1; ranges and labels are not")),
        }
    }

    /// The surface that is called `O`, `I`, `S` or by its number.
    fn numbered(&self, of: &str) -> Option<usize> {
        let surface = match of {
            "O" => Some(0),
            "I" => self.has_image.then(|| self.surfaces.len() - 1),
            "S" => self.stop.as_ref().map(|(surface, _)| *surface),
            number => number.parse::<usize>().ok(),
        };
        surface.filter(|s| *s < self.surfaces.len())
    }

    fn finish(mut self, catalog: &Catalog) -> Result<Import, FileError> {
        // Settle whether numbers are radii or curvatures, and the unit.
        let radii = self.radius_mode.unwrap_or(false);
        if self.radius_mode.is_none() {
            // Radii are usually above a lens unit and curvatures below. Refuse numbers that contradict the default.
            if let Some(raw) = self.surfaces.iter().find(|raw| raw.is_hardly_a_curvature()) {
                let message = "the file does not state whether its surfaces have radii or curvatures";
                let hint =
                    "write a line `RDM` for radii, or `RDM N` for curvatures, before the first surface";
                return Err(raw.record.error(message).hint(hint));
            }
            self.losses.assume("the file has no RDM; its surfaces have curvatures");
        }
        self.report_pickups(radii);
        if self.system.mm == 0.0 {
            self.losses.assume("the file gives no unit; lengths are taken as mm");
            self.system.mm = 1.0;
        }
        let mm = self.system.mm;
        let count = self.surfaces.len();
        if count < 3 || !self.has_image {
            let message = "this is not a lens: it has no object, surface and image";
            let is_cut_short = count > 1 && !self.has_image;
            let hint = if is_cut_short {
                "is the file cut short? its last surface is no image, SI"
            } else {
                "they are SO, S and SI"
            };
            return Err(FileError::at_line(0, "", message).hint(hint));
        }
        // Check object, image and stop.
        let (object, image) = (&self.surfaces[0], &self.surfaces[count - 1]);
        object.check_plane(mm, radii, "object")?;
        image.check_plane(mm, radii, "image")?;
        if object.is_moved() {
            return Err(object.turned.error("a shifted or turned object is not traced"));
        }
        let stop_surface = match &self.stop {
            Some((surface, _)) if (1..count - 1).contains(surface) => *surface,
            Some((_, record)) => return Err(record.error("neither object nor image can be the stop")),
            None => {
                self.losses.assume("the file gives no stop; surface 1 is taken");
                1
            }
        };

        // Make the surfaces with their breaks, and move them along the axis.
        let mut object_mm = object.thickness * mm;
        let object_record = object.record.clone();
        let mut items: Vec<Item> = Vec::with_capacity(count);
        let mut stop = 0;
        let mut front = petzval_optics::glass::Glass::air();
        for raw in &self.surfaces[1..count - 1] {
            let is_stop = std::ptr::eq(raw, &self.surfaces[stop_surface]);
            if is_stop {
                stop = items.len();
            }
            let made = raw.make(mm, radii, &front, &self.private, catalog)?;
            if let Some(said) = &made.substituted {
                let at = &made.drafted.record;
                at.lose(&mut self.losses, Effect::Approximated, said);
            }
            add_to_last(&mut items, &mut object_mm, made.along_mm);
            front = made.drafted.surface.glass.clone();
            let is_plain = made.does_nothing && last_thickness(&items) == Some(0.0) && !is_stop;
            if !(is_plain && made.behind.is_some()) {
                items.push(Item::Surface(Box::new(made.drafted)));
            }
            items.extend(made.behind.map(Item::Break));
        }
        // Place the image; its own thickness is a defocus.
        let image = &self.surfaces[count - 1];
        let turned = image.decenter(mm)?;
        add_to_last(&mut items, &mut object_mm, turned.along_mm);
        if turned.placement.is_some() || turned.behind.is_some() {
            let placed = turned.placement.unwrap_or_default();
            items.push(Item::Break(Break {
                decenter_mm: placed.decenter_mm,
                tilt_rad: placed.tilt_rad,
                record: image.record.clone(),
                ..Break::default()
            }));
        }
        let stored_mm = last_thickness(&items).unwrap_or(0.0);
        let at_paraxial_focus = self.paraxial_image.is_some() && stored_mm == 0.0;
        if let Some(record) = self.paraxial_image.as_ref().filter(|_| at_paraxial_focus) {
            let message = "no distance is stored; the image is at the paraxial focus";
            record.lose(&mut self.losses, Effect::Assumed, message);
        }
        add_to_last(&mut items, &mut object_mm, image.thickness * mm);

        // Collect wavelengths, fields and aperture.
        let (wavelengths, reference) = self.system.wavelengths(&mut self.losses)?;
        let fields = self.system.fields(mm, &mut self.losses);
        let Some((aperture, record)) = self.system.aperture else {
            let message = "the file gives no aperture";
            return Err(FileError::at_line(0, "", message).hint("EPD, FNO, NA and NAO are read"));
        };
        let aperture = match aperture {
            Aperture::EntrancePupil(v) => Aperture::EntrancePupil(v * mm),
            other => other,
        };
        let draft = Draft {
            name: self.system.title,
            source: String::new(),
            items,
            stop,
            aperture: (aperture, record),
            object: (object_mm, object_record),
            wavelengths,
            reference,
            fields,
            at_paraxial_focus,
        };
        draft.finish(self.losses)
    }
}

/// Thickness after the last item, mm.
fn last_thickness(items: &[Item]) -> Option<f64> {
    match items.last()? {
        Item::Surface(drafted) => Some(drafted.surface.thickness_mm),
        Item::Break(b) => Some(b.thickness_mm),
    }
}

/// Moves the next item along the axis.
fn add_to_last(items: &mut [Item], object_mm: &mut f64, along_mm: f64) {
    if along_mm == 0.0 {
        return;
    }
    match items.last_mut() {
        None => *object_mm += along_mm,
        Some(Item::Surface(drafted)) => drafted.surface.thickness_mm += along_mm,
        Some(Item::Break(b)) => b.thickness_mm += along_mm,
    }
}
