// The worker: runs the reader's lines, then each check, and posts what comes out.
{
  const $B = __BRYTHON__;
  const MOST = 20000; // letters that are shown of what the lines print
  const FILE = "lines";
  const DEEP = 20; // rows of a traceback that are shown
  const HINTS = [
    [/NoneType/, "Is a return missing? A function without one gives None."],
    [/'(list|tuple)'|multiply sequence/, "Is a list in the place of an array? Make it one: np.array(...)."],
    [/recursion|call stack/i, "A function calls itself without end."],
  ];
  const TOO_FAR = "IndentationError: unexpected indent";
  let said = 0;
  let lines = []; // of the reader; what follows are the page's

  const say = (text) => {
    const before = said;
    said += String(text).length;
    if (before > MOST) return;
    postMessage({ printed: String(text).slice(0, MOST - before) + (said > MOST ? "\n\u2026 more is not shown" : "") });
  };
  // What Brython itself has to say is for its authors; errors are told below.
  for (const kind of ["log", "error", "info", "warn", "debug"]) console[kind] = () => {};

  // Of a line that is set in too far Brython names the last line of all: the first lines that have
  // this error end at the right one.
  const setIn = () =>
    1 +
    lines.findIndex((_, k) => {
      try {
        return !$B.pythonToAST(lines.slice(0, k + 1).join("\n"), FILE);
      } catch (error) {
        return $B.error_trace($B.exception(error)).trim().endsWith(TOO_FAR);
      }
    });

  // The parts of a traceback that lie in the reader's lines.
  function told(error, asked) {
    const raised = $B.exception(error);
    const trace = $B.error_trace(raised).split("\n");
    const place = /^ {2}File "([^"]*)", line (\d+)/;
    let own = true;
    let line = null;
    const kept = trace.filter((row) => {
      const [, file, number] = place.exec(row) ?? [];
      if (file) own = (file.endsWith(`#${FILE}`) || file === FILE) && +number <= lines.length;
      if (file && own) line = +number;
      return own || /^\S/.test(row);
    });
    line ??= raised.lineno ?? null; // some errors of syntax have no place in their trace
    const half = DEEP / 2;
    if (kept.length > DEEP) kept.splice(half, kept.length - DEEP, "  \u2026");
    const words = kept.join("\n").trim().replace(/File "[^"]*", line/g, "Line");
    if (words.endsWith(TOO_FAR)) return { error: TOO_FAR, line: setIn() };
    const hint = HINTS.find(([kind]) => kind.test(words))?.[1];
    const from = line === null && asked && `The page asked for ${asked.replace(/^\[(.*)\]$/, "$1")}`;
    return { error: [words, from, hint].filter(Boolean).join("\n"), line };
  }

  const run = (code, name) => $B.runPythonSource(code, name);

  // What is asked has one number, or rows of them.
  const ROWS = "found = repr([[float(v) for v in row] for row in (rows if hasattr(rows, '__len__') else [[rows]])])";

  onmessage = ({ data: { code, rest = "", asked } }) => {
    lines = code.split("\n");
    $B.use_VFS = true;
    $B.update_VFS(modules);
    const only = $B.finders.VFS; // modules come from nowhere else, so nothing is asked of a network
    Object.assign($B.finders, { path: only, stdlib_static: only });
    $B.brython({ debug: 1, indexedDB: false });
    try {
      $B.pythonToAST(code, FILE); // is it Python at all?
      console.log = say; // where `print` writes
      run(`${code}\n\n\n${rest}`, FILE);
      let first = null; // error of a check: the others are made all the same
      asked.forEach((call, number) => {
        const ask = `from ${FILE} import *\nrows = ${call}\n${ROWS}`;
        try {
          const check = run(ask, `check_${number}`);
          postMessage({ number, found: String($B.module_getattr(check, "found")) });
        } catch (error) {
          first ??= told(error, call);
          postMessage({ number, broken: true });
        }
      });
      postMessage({ ...first, done: true });
    } catch (error) {
      postMessage({ ...told(error), done: true });
    }
  };
}
