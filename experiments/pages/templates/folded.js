// A link opens what it leads to; a printed page has nothing folded; a plot fits its place once that is seen.
const reveal = () => {
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (!target) return;
  for (let place = target; place; place = place.parentElement) if (place.tagName === "DETAILS") place.open = true;
  target.scrollIntoView();
};
const fit = (place) => {
  if (window.Plotly) place.querySelectorAll(".js-plotly-plot").forEach((plot) => Plotly.Plots.resize(plot));
};
let folded = [];
addEventListener("DOMContentLoaded", reveal);
addEventListener("hashchange", reveal);
addEventListener("beforeprint", () => {
  folded = [...document.querySelectorAll("details:not([open])")];
  folded.forEach((place) => { place.open = true; fit(place); });
});
addEventListener("afterprint", () => folded.forEach((place) => { place.open = false; }));
document.addEventListener("toggle", (event) => fit(event.target), true);
