//! The look at an experiment before its first step, on stdout.

use crate::cli::code::Code;
use crate::jobs::design::FirstLook;

use super::failure::Failure;
use super::number::figure;
use super::terminal::print_json;

/// Prints the look; the exit code says whether a run could give a result.
pub fn print(look: &FirstLook, as_json: bool) -> Result<Code, Failure> {
    let code = if look.problems.is_empty() { Code::SUCCESS } else { Code::INPUT };
    if as_json {
        print_json(look)?;
        return Ok(code);
    }
    outln!("{}", look.experiment);
    for lens in &look.lenses {
        outln!("\n{}: {}", lens.lens, lens.cameras.join(", "));
        outln!("  focal length {:.3} mm, f/{:.2}", lens.efl_mm, lens.f_number);
        let circle = match lens.image_circle_mm {
            Some(circle) => format!(
                ", at {:.0} % of the image circle of the lens file ({circle:.2} mm)",
                100.0 * look.corner_mm / circle
            ),
            None => String::new(),
        };
        outln!("  the sensor's corner lies {:.2} mm from the axis{circle}", look.corner_mm);
        outln!("\n  image mm   field deg   RMS spot um   pixels   light on the grid   illumination");
        for field in &lens.fields {
            outln!(
                "  {:>8.2}   {:>9.2}   {:>11}   {:>6}   {:>15.1} %   {:>12}",
                field.image_mm,
                field.field_deg,
                figure(field.rms_spot_um, 2),
                figure(field.rms_spot_um.map(|um| um / look.pixel_um), 2),
                100.0 * field.light_on_grid,
                figure(field.illumination, 3)
            );
        }
        if lens.violated.is_empty() {
            outln!("\n  every requirement is met");
        }
        for v in &lens.violated {
            outln!("\n  violated: {}, by {:.4} mm", v.requirement, v.by_mm);
        }
    }
    if let Some(photos) = &look.photos {
        outln!(
            "\nphotographs: {} for training, {} held out, {} skipped; each step takes windows of {} pixels of them",
            photos.training,
            photos.held_out,
            photos.skipped,
            photos.window
        );
        if photos.enlarged > 0 {
            outln!(
                "a whole frame of the sensor enlarges {} of them, up to {:.1} times; windows are not enlarged",
                photos.enlarged,
                photos.most_enlarged
            );
        }
    }
    outln!("\n{}", look.steps_in_words());
    for problem in &look.problems {
        outln!("\nproblem: {problem}");
    }
    Ok(code)
}
