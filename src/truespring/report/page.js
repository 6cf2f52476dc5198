// What every page has: light or dark, saving of pictures, scrolling by keyboard. Plain JavaScript without network access.
"use strict";
(() => {
  // --- light or dark ----------------------------------------------------------------------------------------------

  const root = document.documentElement, system = matchMedia("(prefers-color-scheme: dark)");
  const button = document.querySelector(".theme");
  const isDark = () => (root.dataset.theme || (system.matches ? "dark" : "light")) === "dark";
  const show = () => button.setAttribute("aria-pressed", isDark());
  button.hidden = false;
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    try { localStorage.setItem("truespring-theme", root.dataset.theme); } catch { /* for this page only */ }
    show();
  });
  system.addEventListener("change", show);
  show();

  // --- saving -----------------------------------------------------------------------------------------------------

  function save(address, file) {
    const link = Object.assign(document.createElement("a"), { href: address, download: file });
    link.click();
  }

  // A canvas as a PNG file on white paper.
  function saveCanvas(canvas, file) {
    const sheet = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
    const context = sheet.getContext("2d");
    context.fillStyle = "#fff";
    context.fillRect(0, 0, sheet.width, sheet.height);
    context.drawImage(canvas, 0, 0);
    sheet.toBlob((blob) => {
      const address = URL.createObjectURL(blob);
      save(address, file);
      setTimeout(() => URL.revokeObjectURL(address), 10000);
    });
  }

  const SHARP = 3; // pixels of a PNG file of an SVG picture, per pixel of the page

  function savePicture(picture, kind) {
    const file = `${picture.dataset.name}.${kind}`;
    if (picture.src.startsWith(`data:image/${kind}`)) return save(picture.src, file);
    const drawn = Object.assign(document.createElement("canvas"), {
      width: SHARP * picture.naturalWidth, height: SHARP * picture.naturalHeight,
    });
    drawn.getContext("2d").drawImage(picture, 0, 0, drawn.width, drawn.height);
    return saveCanvas(drawn, file);
  }

  for (const picture of document.querySelectorAll("img[data-name]")) {
    const own = picture.src.slice("data:image/".length, picture.src.search(/[+;]/)); // svg, png or gif
    const row = Object.assign(document.createElement("p"), { className: "take" });
    for (const kind of own === "svg" ? ["png", "svg"] : [own]) {
      const one = Object.assign(document.createElement("button"), {
        type: "button", className: "quiet", textContent: kind.toUpperCase(), title: `Save as ${kind.toUpperCase()}`,
      });
      one.setAttribute("aria-label", `${kind.toUpperCase()}: save “${picture.alt}”`);
      one.addEventListener("click", () => savePicture(picture, kind));
      row.append(one);
    }
    picture.after(row);
  }

  // --- what scrolls sideways can be scrolled by keys --------------------------------------------------------------

  const reach = new ResizeObserver((seen) => {
    for (const { target } of seen) {
      if (target.scrollWidth > target.clientWidth) target.tabIndex = 0;
      else target.removeAttribute("tabindex");
    }
  });
  for (const one of document.querySelectorAll(".scroll, pre")) reach.observe(one);

  window.truespringPage = { saveCanvas };
})();
