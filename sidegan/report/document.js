// Plots follow the page: light ink in the dark, dark ink on paper.
(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paint = (night) => document.querySelectorAll(".plotly-graph-div").forEach((plot) =>
    Plotly.relayout(plot, { "font.color": night ? "#c4ccd4" : "#3d4752" }));
  const follow = () => paint(dark.matches);
  dark.addEventListener("change", follow);
  addEventListener("beforeprint", () => paint(false));
  addEventListener("afterprint", follow);
  follow();
})();
