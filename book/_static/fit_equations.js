// An equation that is wider than its column is set smaller, down to half of the text; what is still
// wider scrolls in its own box, from its beginning.
(() => {
  const SMALLEST = 0.5;
  // A font size is rounded, and the number of an equation does not shrink with it.
  const PASSES = 12;

  function fit(equation) {
    const box = equation.parentElement;
    equation.style.fontSize = "";
    const full = parseFloat(getComputedStyle(equation).fontSize);
    for (let pass = 0, share = 1; pass < PASSES && share > SMALLEST; pass += 1) {
      const wide = Math.max(equation.scrollWidth / equation.clientWidth, box.scrollWidth / box.clientWidth);
      if (!(wide > 1)) break;
      share = Math.max(SMALLEST, (share / wide) * 0.99);
      equation.style.fontSize = `${share * full}px`;
    }
    equation.scrollLeft = 0;
    box.scrollLeft = 0;
  }

  const EQUATIONS = 'mjx-container[display="true"]';

  function fitAll() {
    document.querySelectorAll(EQUATIONS).forEach(fit);
  }

  // Equations are set when they are about to be seen: each is put anew into its place.
  function fitNew(changes) {
    for (const node of changes.flatMap(({ addedNodes }) => [...addedNodes]))
      if (node.matches?.(EQUATIONS)) fit(node);
  }

  window.addEventListener("load", () => {
    const typeset = window.MathJax && window.MathJax.startup && window.MathJax.startup.promise;
    if (!typeset) return;
    typeset.then(() => {
      fitAll();
      new MutationObserver(fitNew).observe(document.body, { childList: true, subtree: true });
      // Folded solutions have no width until they are opened; nor does the page keep its own.
      document.addEventListener("toggle", fitAll, true);
      window.addEventListener("resize", fitAll);
    });
  });
})();
