/** One number for all, or one for each. */
export type Row = number | ArrayLike<number>;

/** A row of N balls in line. Ball 0 is the leftmost; velocities to the right are positive. */
export interface Impact {
  /** kg, N numbers above 0. */
  masses: ArrayLike<number>;
  /** m/s before the impact, N numbers. */
  velocities: ArrayLike<number>;
  /** How much of what it takes a contact gives back: N - 1 numbers from 0 to 1. Default 1. */
  restitution?: Row;
  /** The ratio at each inner ball, pushed from the left: N - 2 numbers from 0 to 1. Two balls have none. */
  forward?: Row;
  /** The same, pushed from the right. Default: as `forward`. */
  backward?: Row;
  /** Where two runs of contacts meet: the share of the left one, from 0 to 1. Default 0.5. */
  meeting?: number;
  /** Hold a contact whose ratio is above its largest value (true, the default), or throw. */
  saturate?: boolean;
  /** Steps after which an impact is given up. Default 20000 (5 million in Python). */
  maxEvents?: number;
  /** Whether to keep what happened: events and paths. Default true. */
  record?: boolean;
}

export interface Outcome {
  /** "unfinished": given up after `maxEvents`; the numbers are those reached. */
  status: "finished" | "unfinished";
  /** m/s after the impact, N. */
  velocities: number[];
  /** N s, total of each contact, N - 1. */
  impulses: number[];
  /** J, taken up in compression by each contact, N - 1. */
  absorbed: number[];
  /** How often each contact became active, N - 1. */
  collisions: number[];
  /** Whether a sequence of collisions without end was taken to its limit. */
  collapsed: boolean;
  /** Contacts that were held, as their ratio is above its largest value. */
  saturated: number[];
  /** How close another order of events came: small is close. */
  margin: number;
}

export type Kind = "maximum_compression" | "end" | "close" | "collapse" | "repetition";

export interface Recorded extends Outcome {
  /** What happened, in order, and at which contact. */
  events: { kind: Kind; contact: number }[];
  /** Velocities before the impact and after each event. */
  path: number[][];
  /** Impulses before the impact (zeros) and after each event. */
  pathImpulses: number[][];
}

/** An answer that did not pass the solver's own checks: it has no numbers. */
export interface Unsound {
  status: "unsound";
  defect: string;
}

/** Solve an impact, without a record, for sweeps. */
export function collide(impact: Impact & { record: false }): Outcome | Unsound;
/** Solve an impact, with all that happened in it. Throws an Error that names a wrong input. */
export function collide(impact: Impact & { record?: true }): Recorded | Unsound;
export function collide(impact: Impact): Recorded | Outcome | Unsound;

/** Solve an impact without a record. */
export function outcome(impact: Impact): Outcome | Unsound;

/** The largest ratios at which no contact would have to pull, N - 2 each. */
export function largestRatios(
  masses: ArrayLike<number>,
  forward?: Row,
  backward?: Row,
): { forward: number[]; backward: number[] };
