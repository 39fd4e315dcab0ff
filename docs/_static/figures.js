// On a narrow screen a tap shows a figure in its full size, within a box that scrolls sideways; the
// next tap makes it fit again. Without this script the figure is a link to its file.
"use strict";

const narrow = window.matchMedia("(max-width: 44em)");

document.addEventListener("click", (event) => {
  const link = event.target.closest(".cell_output a.image-reference");
  if (!link || !narrow.matches || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  const image = link.getBoundingClientRect();
  const there = (event.clientX - image.left) / image.width;
  link.classList.toggle("enlarged");
  // What was tapped stays under the finger.
  link.scrollLeft = there * link.scrollWidth - (event.clientX - image.left);
});
