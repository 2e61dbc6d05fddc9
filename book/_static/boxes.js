// A box that is folded: its button has the name of the box, and a link into it opens it.
window.addEventListener("load", () => {
  for (const button of document.querySelectorAll(".toggle-button"))
    button.setAttribute("aria-label", button.parentElement.textContent.trim());

  function open() {
    const place = document.querySelector(":target");
    const box = place?.closest(".toggle-hidden");
    box?.querySelector(".toggle-button").click();
    if (box) place.scrollIntoView();
  }
  window.addEventListener("hashchange", open);
  open();
});
