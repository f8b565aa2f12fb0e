// Shows a picture large; arrow keys flick through the cameras in place, which shows more than any two
// pictures side by side.
const viewer = document.getElementById("viewer");
const large = viewer.querySelector("img");
const name = viewer.querySelector("output");
let group = [];
let at = 0;

function show(i) {
  at = (i + group.length) % group.length;
  const source = group[at].querySelector("img");
  large.src = source.src;
  large.alt = source.alt;
  name.textContent = group[at].dataset.name;
}

document.querySelectorAll("button.frame").forEach((button) =>
  button.addEventListener("click", () => {
    group = [...document.querySelectorAll(`button.frame[data-group="${button.dataset.group}"]`)];
    show(group.indexOf(button));
    viewer.showModal();
  }),
);
viewer.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (button?.dataset.step) show(at + Number(button.dataset.step));
  else if (button || event.target === viewer) viewer.close();
});
viewer.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (step) show(at + step);
});
