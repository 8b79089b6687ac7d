// Equations of the effects' catalogue are AsciiMath between backquotes.
window.MathJax = {
  loader: { load: ["input/asciimath", "output/chtml"] },
  asciimath: { delimiters: [["`", "`"]] },
  options: { ignoreHtmlClass: ".*|", processHtmlClass: "equation" },
};
document$.subscribe(() => window.MathJax.typesetPromise?.());
