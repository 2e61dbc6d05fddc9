// The worker: runs the reader's lines, then each check, and posts what comes out.
{
  const $B = __BRYTHON__;
  const MOST = 20000; // letters that are shown of what the lines print
  const FILE = "lines";
  const HINTS = [
    [/NoneType/, "Is a return missing? A function without one gives None."],
    [/'(list|tuple)'|multiply sequence/, "Is a list in the place of an array? Make it one: np.array(...)."],
    [/recursion|Previous line repeated/i, "A function calls itself without end."],
  ];
  let said = 0;
  let rows = 0; // lines of the reader; what follows are the page's

  const say = (text) => {
    if (said < MOST) postMessage({ printed: String(text).slice(0, MOST - said) });
    said += String(text).length;
  };
  // What Brython itself has to say is for its authors; errors are told below.
  for (const kind of ["log", "error", "info", "warn", "debug"]) console[kind] = () => {};

  // The parts of a traceback that lie in the reader's lines.
  function told(error) {
    const raised = $B.exception(error);
    const trace = $B.error_trace(raised).split("\n");
    const place = /^ {2}File "([^"]*)", line (\d+)/;
    let own = true;
    let line = null;
    const kept = trace.filter((row) => {
      const [, file, number] = place.exec(row) ?? [];
      if (file) own = (file.endsWith(`#${FILE}`) || file === FILE) && +number <= rows;
      if (file && own) line = +number;
      return own || /^\S/.test(row);
    });
    line ??= raised.lineno ?? null; // some errors of syntax have no place in their trace
    const words = kept.join("\n").replace(/File "[^"]*", line/g, "Line");
    const hint = HINTS.find(([kind]) => kind.test(words))?.[1];
    return { error: [words.trim(), ...(hint ? [hint] : [])].join("\n"), line };
  }

  const run = (code, name) => $B.runPythonSource(code, name);

  // What is asked has one number, or rows of them.
  const ROWS = "found = repr([[float(v) for v in row] for row in (rows if hasattr(rows, '__len__') else [[rows]])])";

  onmessage = ({ data: { code, rest = "", asked } }) => {
    rows = code.split("\n").length;
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
          first ??= told(error);
          postMessage({ number, broken: true });
        }
      });
      postMessage({ ...first, done: true });
    } catch (error) {
      postMessage({ ...told(error), done: true });
    }
  };
}
