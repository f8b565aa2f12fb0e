// The parts of requests and responses of jobs that the page uses; `petzval schema job NAME` prints them whole.

export type Point = [number, number];

export type Edit =
  | { edit: "radius"; surface: number; radius_mm: number | null }
  | { edit: "curvature"; surface: number; curvature_per_mm: number }
  | { edit: "sag"; surface: number; height_mm: number; sag_mm: number }
  | { edit: "bend"; surface: number; by_per_mm: number }
  | { edit: "conic"; surface: number; conic: number }
  | { edit: "asphere"; surface: number; power: number; value: number }
  | { edit: "thickness"; surface: number; thickness_mm: number }
  | { edit: "semi-diameter"; surface: number; semi_diameter_mm: number }
  | { edit: "glass"; surface: number; glass: string }
  | { edit: "label"; surface: number; label: string }
  | { edit: "stop"; surface: number }
  | { edit: "insert"; before: number }
  | { edit: "delete"; surface: number }
  | { edit: "aperture"; entrance_pupil_mm: number }
  | { edit: "fields"; fields_deg: number[] }
  | { edit: "wavelengths"; wavelengths_um: number[]; reference_um: number }
  | { edit: "object"; distance_mm: number | null }
  | { edit: "name"; name: string }
  | { edit: "focus"; at: "paraxial" | "best" }
  | { edit: "scale-to"; efl_mm: number }
  | { edit: "vary"; surface: number; parameter: string; min?: number; max?: number }
  | { edit: "hold"; surface: number; parameter: string }
  | { edit: "pickup"; surface: number; parameter: string; of: number; scale: number; offset: number }
  | { edit: "field-weights"; weights: number[] }
  | { edit: "solve-magnification"; surface: number | null; magnification?: number }
  | { edit: "solve-length"; surface: number | null; length_mm?: number }
  | { edit: "solve-efl"; surface: number | null; efl_mm?: number };

export interface Row {
  surface: number;
  label: string;
  action: "refract" | "reflect" | "thin-lens";
  radius_mm: number | null;
  curvature_per_mm: number;
  conic: number;
  asphere: number[];
  thickness_mm: number;
  glass: string;
  nd: number | null;
  vd: number | null;
  semi_diameter_mm: number;
  is_stop: boolean;
  vertex: Point | null;
  edge_sag_mm: number | null;
  special: string[];
  varies: Variable[];
  settled: { parameter: string; by: SettledBy }[];
}

export interface Variable {
  parameter: string;
  min: number;
  max: number;
}

/** What settles a number. */
export type SettledBy =
  | { pickup: { of: number; scale: number; offset: number } }
  | { efl: { efl_mm: number } }
  | { magnification: { magnification: number } }
  | { length: { length_mm: number } };

export interface FirstOrder {
  efl_mm: number | null;
  bfl_mm: number | null;
  f_number: number | null;
  working_f_number: number | null;
  image_na: number;
  image_mm: number;
  defocus_mm: number | null;
  total_track_mm: number | null;
  entrance_pupil_mm: number;
  exit_pupil_mm: number | null;
  stop_radius_mm: number;
  full_field_deg: number;
  image_height_mm: number | null;
  petzval_radius_mm: number | null;
  airy_radius_um: number | null;
  cutoff_per_mm: number;
  magnification: number | null;
}

export interface Layout {
  elements: { glass: string; nd: number | null; vd: number | null; outline: Point[] }[];
  lines: { kind: string; points: Point[] }[];
  rays: { points: Point[]; is_lost: boolean }[][];
  axis: Point[];
  stop: [[Point, Point], [Point, Point]];
  image: [Point, Point];
}

export interface Spot {
  field_deg: number;
  points_um: Point[][];
  centroid_um: Point;
  rms_um: number;
  geometric_radius_um: number;
  airy_radius_um: number;
}

type Curve = (number | null)[];

export interface Fan {
  field_deg: number;
  pupil: number[];
  tangential_um: Curve[];
  sagittal_um: Curve[];
}

export interface MtfCurve {
  sagittal: number[];
  tangential: number[];
}

export interface Mtf {
  field_deg: number;
  frequency_per_mm: number[];
  geometric: MtfCurve;
  diffraction: MtfCurve | null;
  limit: MtfCurve | null;
}

export interface FieldCurves {
  field_deg: number[];
  tangential_focus_mm: number[][];
  sagittal_focus_mm: number[][];
  distortion_percent: number[][];
  lateral_colour_um: number[][];
  relative_illumination: number[][];
}

export interface Violation {
  surface: number | null;
  what: string;
  excess_mm: number | null;
}

export interface Loss {
  line: number | null;
  record: string;
  effect: string;
  message: string;
  more: number;
}

/** An image plane far from the best focus. */
export interface Defocus {
  moved_mm: number;
  rms_spot_um: number;
  best_rms_spot_um: number;
}

export interface View {
  toml: string;
  name: string;
  source: string;
  surfaces: Row[];
  entrance_pupil_mm: number;
  object_distance_mm: number | null;
  wavelengths_um: number[];
  stated_wavelengths_um: number[];
  reference_um: number;
  fields_deg: number[];
  stated_fields_deg: number[];
  /** One per stated field; none if all are the same. */
  field_weights: number[];
  solved_efl_mm: number | null;
  first_order: FirstOrder;
  is_quick: boolean;
  layout: Layout | null;
  spots: Spot[];
  fans: Fan[];
  mtf: Mtf[];
  field_curves: FieldCurves | null;
  violations: Violation[];
  problems: string[];
  out_of_focus: Defocus | null;
  losses_of_reading: Loss[];
}

export interface CameraView {
  height: number;
  width: number;
  rgb: string | Uint8Array;
  raw: string | Uint8Array | null;
  placement: Point;
  array: Point;
  is_own_array: boolean;
  pixel_um: number;
  image_radius_mm: number;
  relative_radius: number;
  white_e: number;
  saturated_share: number;
  gray_snr_db: number;
  histogram: { raw: number[]; developed: number[][] };
  is_quick: boolean;
  psf_fields: number;
  pupil_cells: number;
  patches: Point;
  enlarged: number;
  edges: MeasuredEdge[];
}

/** Pixels of a picture. */
export interface EdgeRegion {
  row: number;
  col: number;
  height: number;
  width: number;
}

export interface MeasuredEdge {
  region: EdgeRegion;
  channels: {
    channel: string;
    angle_deg: number;
    mtf50_per_px: number | null;
    overshoot: number;
    standard_errors: { mtf50_per_px: number | null };
    frequency_per_px: number[];
    modulation: number[];
  }[];
}

export interface ErrorReport {
  kind: string;
  message: string;
  hint?: string;
  place?: Place;
  stopped?: { response?: unknown; kept?: string[] };
}

/** A file, request key or place that an error names. */
export interface Place {
  path?: string;
  line?: number;
  column?: number;
  key?: string;
  value?: string;
}

export type JobEvent =
  | { event: "step"; camera: string; block: string; step: number; total: number; losses: Record<string, number | null> }
  | { event: "scoring"; camera: string; done: number; total: number }
  | { event: "camera"; camera: string }
  | { event: "error"; message: string; hint?: string }
  | { event: "warning"; text: string }
  | { event: "note"; text: string; figures?: Record<string, number | null> }
  | { event: "progress"; done: number; total: number; text: string; figures?: Record<string, number | null> }
  | { event: "file"; path: string; what: string };

export interface Opened {
  name: string;
  toml: string;
  losses: Loss[];
}

export type Room = "lens" | "camera" | "task" | "design" | "runs";

/** What the studio was started with. */
export interface First {
  room: Room;
  run: string | null;
  experiment: string | null;
  sweep: string | null;
  runs: string | null;
}

export interface State {
  version: string;
  folder: string;
  files: string[];
  opened: Opened[];
  first: First;
}

export type RunState = "finished" | "running" | "stopped" | "damaged";

export interface RunRow {
  run: string;
  experiment: string;
  state: RunState;
  reason?: string;
  step: number;
  total: number;
  camera?: string;
  scores: { name: string; title: string; unit: string; decimals: number; value: number }[];
  seconds: number;
  begun: string;
  differs: Record<string, string>;
}

export interface UnitRow {
  store: string;
  name: string;
  job: string;
  state: string;
  reason?: string;
  seconds?: number;
  run?: RunRow;
}

export interface Runs {
  runs: RunRow[];
  units: UnitRow[];
}

export interface RunStep {
  step: number;
  camera: string;
  block: string;
  losses: Record<string, number | null>;
  seconds: number;
}

export interface ScoreDescription {
  name: string;
  title: string;
  unit: string;
  decimals: number;
  higher_is_better: boolean;
}

export interface CameraMetrics {
  camera: string;
  is_ceiling?: boolean;
  rms_spot_um: number;
  efl_mm: number;
  f_number: number;
  fov_deg: number;
  [score: string]: unknown;
}

export interface RunView {
  row: RunRow;
  time_left: { seconds: number; is_least: boolean } | null;
  holder: { host: string; pid: number } | null;
  variants: { name: string; first_step: number; stages: { goal: string; steps: Record<string, number>; iterations: number }[]; is_finished: boolean }[];
  steps: RunStep[];
  every: number;
  lenses: { step: number; camera: string; lens: string }[];
  cameras: CameraMetrics[];
  scores: ScoreDescription[];
  pictures: string[];
  report: string | null;
  config: string;
}

export interface Spread {
  count: number;
  mean: number;
  deviation: number | null;
  low: number;
  high: number;
}

export interface Gathered {
  title: string;
  keys: string[];
  figures: { name: string; title: string; unit: string; decimals: number | null; higher_is_better: boolean | null }[];
  rows: { camera: string; is_ceiling: boolean; values: unknown[]; units: string[]; figures: (Spread | null)[] }[];
  units: { unit: string; camera: string; is_ceiling: boolean; values: unknown[]; seed: number | null; figures: (number | null)[]; files: string | null }[];
}

export interface Glass {
  name: string;
  maker: string;
  status: string | null;
  nd: number | null;
  vd: number | null;
}
