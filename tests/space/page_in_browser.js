// Mouse, wheel, two fingers, keys, views and the slider, each of which must change the picture.
const canvas = document.getElementById("layout"), pixels = () => {
  const image = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return image.reduce((a, x, i) => (a * 31 + x * (i % 97)) % 1000003, 7); };
canvas.setPointerCapture = () => {};
window.requestAnimationFrame = (act) => act();
const pointer = (kind, id, x, y, more) => canvas.dispatchEvent(new PointerEvent(kind, { pointerId: id, clientX: x, clientY: y, buttons: 1, bubbles: true, ...more }));
seen.pictures = [pixels()];
const keep = () => seen.pictures.push(pixels());
pointer("pointerdown", 1, 300, 300); pointer("pointermove", 1, 340, 330); pointer("pointerup", 1, 340, 330); keep();
canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -300, clientX: 380, clientY: 280, cancelable: true })); keep();
pointer("pointerdown", 1, 300, 300); pointer("pointermove", 1, 360, 300, { shiftKey: true }); pointer("pointerup", 1, 360, 300); keep();
canvas.dispatchEvent(new MouseEvent("dblclick")); seen.back = pixels();
pointer("pointerdown", 1, 280, 280); pointer("pointerdown", 2, 480, 280); pointer("pointermove", 2, 620, 280); pointer("pointerup", 1, 0, 0); pointer("pointercancel", 2, 0, 0); keep();
canvas.dispatchEvent(new MouseEvent("dblclick"));
canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" })); keep();
for (const button of document.querySelectorAll("#views button")) { button.click(); if (button.textContent !== "perspective") keep(); }
const slider = document.getElementById("time"); slider.value = 40; slider.dispatchEvent(new Event("input")); keep();
seen.sharp = canvas.width / 760;
