// The slider that moves the pictures of a run, or of inspections, whose `instants` are dates.
function setInstant(instant) {
  const { frames } = page.content, slider = document.getElementById("instant");
  page.instant = Math.max(0, Math.min(frames.length - 1, instant));
  slider.value = `${page.instant}`;
  const text = page.content.instants ? page.content.instants[page.instant] : `${frames[page.instant].toFixed(4)} s`;
  slider.setAttribute("aria-valuetext", text);
  document.getElementById("clock").textContent = text;
  if (!page.waiting) page.waiting = requestAnimationFrame(() => {
    page.waiting = 0;
    page.figures.filter((each) => each.visible).forEach(moveFigure);
  });
}

function play(button) {
  clearInterval(page.timer);
  page.timer = page.timer ? 0 : setInterval(() => setInstant((page.instant + 1) % page.content.frames.length), 80);
  button.textContent = page.timer ? "Pause" : "Play";
}

function prepareSlider() {
  const slider = document.getElementById("instant"), button = document.getElementById("play");
  slider.max = `${page.content.frames.length - 1}`;
  slider.addEventListener("input", () => setInstant(Number(slider.value)));
  button.addEventListener("click", () => play(button));
  document.getElementById("player").addEventListener("submit", (event) => event.preventDefault());
  document.getElementById("player").hidden = page.content.frames.length < 2;
  setInstant(page.content.begin ?? page.content.frames.length - 1);
}

page.begin = prepareSlider;
