// Sliders between drapes: shapes, and the ease of each zone, are multilinear in what the sliders say.
(() => {
  "use strict";
  const byId = (id) => document.getElementById(id);
  const grid = JSON.parse(byId("grid").textContent);
  const STEPS = 200; // of a slider
  const options = grid.choices.map(() => 0);
  const values = grid.sliders.map((one) => one.values[Math.floor((one.values.length - 1) / 2)]);
  const asked = /^#([-\d.]+(,[-\d.]+)*)$/.exec(location.hash); // page.html#92,164 opens at these values
  if (asked) {
    asked[1].split(",").slice(0, values.length).forEach((value, k) => {
      const all = grid.sliders[k].values;
      values[k] = Math.min(Math.max(Number(value) || 0, all[0]), all[all.length - 1]);
    });
  }

  function element(tag, text, into, attributes = {}) {
    const made = document.createElement(tag);
    made.textContent = text;
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    into.append(made);
    return made;
  }

  /** The interval of increasing values that a value lies in: its first, and how far on it is, from 0 to 1. */
  function interval(all, value) {
    let k = 0;
    while (k < all.length - 2 && value > all[k + 1]) k++;
    return [k, all.length > 1 ? (value - all[k]) / (all[k + 1] - all[k]) : 0];
  }

  /** Drapes about the sliders' values, each with its share. */
  function shares() {
    let found = [[0, 1]];
    grid.sliders.forEach((one, axis) => {
      const [k, on] = interval(one.values, values[axis]);
      const ends = on > 0 ? [[k, 1 - on], [k + 1, on]] : [[k, 1]];
      found = found.flatMap(([at, share]) => ends.map(([end, part]) => [at * one.values.length + end, share * part]));
    });
    return found.filter(([, share]) => share > 0);
  }

  /** The mean ease of a zone that all these drapes have, else that of the nearest [cm]. */
  function ease(zone, fits, found, nearest) {
    if (found.every(([at]) => zone in fits[at].ease_cm)) {
      return found.reduce((sum, [at, share]) => sum + share * fits[at].ease_cm[zone], 0);
    }
    return fits[nearest].ease_cm[zone];
  }

  function show() {
    const began = performance.now();
    const chosen = grid.choices.reduce((at, one, k) => at * one.options.length + options[k], 0);
    const { layers, fits } = grid.fitted[chosen];
    const found = shares();
    const nearest = found.reduce((best, one) => (one[1] > best[1] ? one : best))[0];
    if (viewer) viewer.blend(layers, found);
    byId("state").textContent = `${found.length > 1 ? "Nearest drape: " : "Draped: "}${fits[nearest].verdict}`;
    byId("zones").replaceChildren();
    for (const zone of Object.keys(fits[nearest].ease_cm)) {
      const row = element("tr", "", byId("zones"));
      element("td", zone, row);
      const mean = ease(zone, fits, found, nearest);
      element("td", `${mean < 0 ? "−" : "+"}${Math.abs(mean).toFixed(1)}`, row, { class: "n" });
    }
    document.body.dataset.ms = (performance.now() - began).toFixed(1);
  }

  grid.choices.forEach((one, k) => {
    const bar = element("div", "", byId("choices"), { class: "bar", role: "group", "aria-label": one.name });
    element("span", one.name, bar);
    const buttons = one.options.map((option, at) => element("button", option, bar, { type: "button", "aria-pressed": at === 0 }));
    buttons.forEach((button, at) => button.addEventListener("click", () => {
      options[k] = at;
      buttons.forEach((other, n) => other.setAttribute("aria-pressed", n === at));
      show();
    }));
  });
  grid.sliders.forEach((one, k) => {
    const [low, high] = [one.values[0], one.values[one.values.length - 1]];
    const bar = element("div", "", byId("sliders"), { class: "bar" });
    element("label", one.name, bar, { for: `slider${k}` });
    const slider = element("input", "", bar, {
      id: `slider${k}`, type: "range", min: low, max: high, step: (high - low) / STEPS || "any", list: `drapes${k}`,
    });
    const marks = element("datalist", "", bar, { id: `drapes${k}` });
    for (const value of one.values) element("option", "", marks, { value });
    const told = element("output", "", bar, { for: `slider${k}` });
    const tell = () => (told.textContent = `${Number(values[k].toPrecision(4))} ${one.unit}`.trim());
    slider.value = values[k];
    slider.addEventListener("input", () => {
      values[k] = Number(slider.value);
      tell();
      show();
    });
    tell();
  });
  show();
})();
