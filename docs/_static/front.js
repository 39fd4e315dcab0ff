// The slider of the front page: the best model for each dead time that one assumes. The models are in the page.
"use strict";

document.addEventListener("DOMContentLoaded", () => {
  for (const figure of document.querySelectorAll(".front-picture")) {
    const stored = JSON.parse(figure.querySelector("script").textContent);
    const slider = figure.querySelector("input");
    const line = figure.querySelector(".assumed");
    const show = () => {
      const k = Number(slider.value);
      const assumed = stored.deadTimes[k];
      figure.querySelector(".model").setAttribute("d", stored.paths[k]);
      line.setAttribute("x1", stored.x[k]);
      line.setAttribute("x2", stored.x[k]);
      const inside = stored.interval[0] <= assumed && assumed <= stored.interval[1];
      figure.classList.toggle("outside", !inside);
      figure.querySelector(".said").textContent =
        `With ${assumed} s the best model misses the record by ${stored.misses[k]} °C rms: ` +
        (inside ? "the data allow it." : "the data rule it out.");
    };
    slider.addEventListener("input", show);
    figure.querySelector("label").hidden = false;
    show();
  }
});
