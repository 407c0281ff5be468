// Pairs of words of one drawing that overlap, of blocks of the page that do, and blocks wider than the window.
const overlaps = () => {
  const found = [], meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const check = (nodes) => nodes.forEach((one, k) => nodes.slice(k + 1).forEach((other) => {
    if (meet(one.getBoundingClientRect(), other.getBoundingClientRect())) found.push(`${one.textContent.slice(0, 30)} | ${other.textContent.slice(0, 30)}`); }));
  for (const drawing of document.querySelectorAll("svg")) check([...drawing.querySelectorAll("text")]);
  check([...document.querySelectorAll("header, #results, #scene, #plots, details")]);
  check([...document.querySelectorAll("#scene > *")]);
  for (const block of document.querySelectorAll("section, details, table, svg, canvas")) if (block.getBoundingClientRect().right > window.innerWidth + 1 && !block.closest("#parts, pre")) found.push(`${block.id || block.tagName} is too wide`);
  return found;
};
