// What Python's numbers do and JavaScript's do not by themselves.

// A number of 32 digits: a pair, which nothing changes.
function complex(real, imag) {
  return { real, imag };
}

// As in Python the first of two equals is kept, so 0 and -0 stay what they are.
function max(a, b) {
  return b > a ? b : a;
}

function min(a, b) {
  return b < a ? b : a;
}

// Powers of two from 2 ** -1074, the least number, to 2 ** 1023: each the double of the one before.
const LEAST = -1074;
const LARGEST = 1023;
const POWERS = [5e-324];
for (let k = LEAST; k < LARGEST; k += 1) POWERS.push(2 * POWERS[POWERS.length - 1]);

// Return [f, k] with x = f * 2 ** k and 0.5 <= |f| < 1.
function frexp(x) {
  if (x === 0 || !Number.isFinite(x)) return [x, 0];
  if (Math.abs(x) < POWERS[-1022 - LEAST]) {
    const [f, k] = frexp(x * POWERS[54 - LEAST]);
    return [f, k - 54];
  }
  // A logarithm is a good guess and may be one off. 2 ** -k could overflow, so half at a time.
  let k = Math.floor(Math.log2(Math.abs(x))) + 1;
  const half = Math.trunc(k / 2);
  let f = x * POWERS[-half - LEAST] * POWERS[half - k - LEAST];
  while (Math.abs(f) >= 1) {
    f *= 0.5;
    k += 1;
  }
  while (Math.abs(f) < 0.5) {
    f *= 2;
    k -= 1;
  }
  return [f, k];
}

// Return x * 2 ** k, rounded once.
function ldexp(x, k) {
  for (; k > LARGEST && Number.isFinite(x); k -= LARGEST) x *= POWERS[LARGEST - LEAST];
  // A product below 2 ** -1022 is rounded. By 2 ** -969 none is that will not be zero in the end.
  for (; k < -1022 && x !== 0; k += 969) x *= POWERS[-969 - LEAST];
  return Number.isFinite(x) && x !== 0 ? x * POWERS[k - LEAST] : x;
}

// Return a number as Python prints it.
function shown(x) {
  if (typeof x === "string") return JSON.stringify(x);
  if (typeof x !== "number") return typeof x === "bigint" ? `${x}n` : `${x}`;
  if (!Number.isFinite(x)) return Number.isNaN(x) ? "nan" : x > 0 ? "inf" : "-inf";
  if (Object.is(x, -0)) return "-0.0";
  const size = Math.abs(x);
  if (size >= 1e16 || (size < 1e-4 && size > 0)) {
    const [digits, power] = x.toExponential().split("e");
    return `${digits}e${power[0]}${power.slice(1).padStart(2, "0")}`;
  }
  return Number.isInteger(x) ? `${x}.0` : `${x}`;
}

// Return a row of numbers within limits; one number stands for all. The sentences of a refusal are
// those of the package.
function row(name, given, size, rule = "must be finite", low = -Infinity, high = Infinity) {
  const several = Array.isArray(given) || ArrayBuffer.isView(given);
  const values = several ? Array.from(given) : [given];
  values.forEach((value, at) => {
    const here = several ? `${name}[${at}]` : name;
    if (typeof value !== "number") throw new Error(`${here} = ${shown(value)}; must be a real number`);
    if (!Number.isFinite(value)) throw new Error(`${here} = ${shown(value)}; must be finite`);
    if (!(value >= low && value <= high)) throw new Error(`${here} = ${shown(value)}; ${rule}`);
  });
  if (!several && size !== undefined) return Array(size).fill(given);
  return values;
}

// Return the shape of what should be a row, as Python prints it.
function shape(given) {
  return typeof given === "number" ? "()" : `(${given.length},)`;
}

// Return one number within limits.
function one(name, given, rule, low, high) {
  if (typeof given !== "number") throw new Error(`${name} = ${shown(given)}; must be one number`);
  return row(name, given, undefined, rule, low, high)[0];
}
