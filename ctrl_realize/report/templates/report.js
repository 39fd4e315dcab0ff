// Zoom, pan and read-out of the figures. Without it they are pictures, which they stay on paper.
"use strict";
for (const svg of document.querySelectorAll("svg.plot")) {
  const figure = svg.closest("figure");
  const axes = JSON.parse(svg.dataset.axes);
  const whole = svg.getAttribute("viewBox").split(" ").map(Number);
  let view = whole;

  const bar = document.createElement("div");
  bar.className = "tools";
  const button = (text, name, act) => {
    const made = bar.appendChild(document.createElement("button"));
    made.type = "button";
    made.textContent = text;
    made.title = name;
    made.setAttribute("aria-label", name);
    made.addEventListener("click", act);
    return made;
  };
  button("+", "closer", () => zoom(1.5));
  const less = button("−", "farther", () => zoom(1 / 1.5));
  const all = button("⤢", "whole figure", () => show(whole));
  const values = bar.appendChild(document.createElement("output"));
  values.setAttribute("aria-live", "off");
  svg.after(bar);

  // The part [x, y, width, height] of the drawing that fills the figure.
  function show(part) {
    const inside = (start, size, i) =>
      Math.min(Math.max(start, whole[i]), whole[i] + whole[i + 2] - size);
    view = [inside(part[0], part[2], 0), inside(part[1], part[3], 1), part[2], part[3]];
    svg.setAttribute("viewBox", view.join(" "));
    less.disabled = all.disabled = view[2] >= whole[2];
    svg.classList.toggle("near", view[2] < whole[2]);
  }
  function zoom(factor, at = [view[0] + view[2] / 2, view[1] + view[3] / 2]) {
    const width = Math.min(Math.max(view[2] / factor, whole[2] / 40), whole[2]);
    const share = width / view[2];
    show([at[0] - share * (at[0] - view[0]), at[1] - share * (at[1] - view[1]),
      width, share * view[3]]);
  }
  const pan = (right, down) => show([view[0] + right, view[1] + down, view[2], view[3]]);
  const place = (event) => {
    const box = svg.getBoundingClientRect();
    return [view[0] + (event.clientX - box.left) / box.width * view[2],
      view[1] + (event.clientY - box.top) / box.height * view[3]];
  };

  const keys = {
    "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5), "0": () => show(whole),
    ArrowLeft: () => pan(-view[2] / 8, 0), ArrowRight: () => pan(view[2] / 8, 0),
    ArrowUp: () => pan(0, -view[3] / 8), ArrowDown: () => pan(0, view[3] / 8),
  };
  figure.tabIndex = -1; // a click on the drawing leaves the keys with this figure
  figure.addEventListener("keydown", (event) => {
    const act = keys[event.key];
    const page = event.ctrlKey || event.metaKey || event.altKey;
    if (!act || page || (event.key.startsWith("Arrow") && view[2] >= whole[2])) return;
    event.preventDefault();
    act();
  });
  svg.addEventListener("dblclick", (event) => zoom(2, place(event)));
  // The wheel alone belongs to the page.
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 300), place(event));
  }, { passive: false });

  let held = null;
  svg.addEventListener("pointerdown", (event) => {
    values.textContent = read(...place(event));
    if (event.button !== 0 || view[2] >= whole[2]) return;
    held = place(event);
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    if (held) pan(held[0] - x, held[1] - y);
    else values.textContent = read(x, y);
  });
  // What a finger touched stays to be read when it is lifted.
  svg.addEventListener("pointerleave", (event) => {
    if (event.pointerType === "mouse") values.textContent = "";
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { held = null; });
  addEventListener("beforeprint", () => show(whole));

  function read(x, y) {
    const under = axes.find(({ box: [left, top, width, height] }) =>
      x >= left && x <= left + width && y >= top && y <= top + height);
    if (!under) return "";
    const [left, top, width, height] = under.box;
    const value = (axis, share) => {
      if (!axis) return [];
      const [from, to, logarithmic, unit] = axis;
      const found = logarithmic ? from * (to / from) ** share : from + share * (to - from);
      return [`${Number(found.toPrecision(4))} ${unit}`.trim()];
    };
    return [...value(under.x, (x - left) / width),
      ...value(under.y, (top + height - y) / height)].join(", ");
  }
  show(whole);
}
