// A box that scrolls sideways says on which sides more is; custom.css shades its edges there.
(() => {
  const BOXES =
    ".figure-box, .output, .pst-scrollable-table-container, .notation, .math, mjx-container, pre, textarea";

  function say(box) {
    const hidden = box.scrollWidth - box.clientWidth;
    const scrolls = ["auto", "scroll"].includes(getComputedStyle(box).overflowX);
    const left = scrolls && box.scrollLeft > 1;
    const right = scrolls && box.scrollLeft < hidden - 1;
    box.dataset.more = `${left ? "left" : ""} ${right ? "right" : ""}`.trim();
  }

  window.addEventListener("DOMContentLoaded", () => {
    // Hears of a box when it is first seen, unfolded or turned; and when what it holds grows.
    const sizes = new ResizeObserver((boxes) => boxes.forEach(({ target }) => say(target)));
    const watch = (node) => node.querySelectorAll(BOXES).forEach((box) => sizes.observe(box));
    document.querySelectorAll(".bd-content").forEach((content) => {
      watch(content);
      new MutationObserver((changes) =>
        changes.forEach(({ target }) => watch(target)),
      ).observe(content, { childList: true, subtree: true });
    });
    document.addEventListener("scroll", ({ target }) => target.matches?.(BOXES) && say(target), true);
  });
})();
