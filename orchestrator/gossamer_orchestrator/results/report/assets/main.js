// Unpack, draw one picture after the other, and let the slider move them.
function setInstant(instant) {
  const { frames } = page.content, slider = document.getElementById("instant");
  page.instant = Math.max(0, Math.min(frames.length - 1, instant));
  slider.value = `${page.instant}`;
  const text = `${frames[page.instant].toFixed(4)} s`;
  slider.setAttribute("aria-valuetext", text);
  document.getElementById("clock").textContent = text;
  if (!page.waiting) page.waiting = requestAnimationFrame(() => {
    page.waiting = 0;
    page.figures.filter((each) => each.visible).forEach(moveFigure);
  });
}

function play(button) {
  const begin = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", `${begin}`);
  button.textContent = begin ? "Pause" : "Play";
  clearInterval(page.timer);
  if (begin) page.timer = setInterval(() => setInstant((page.instant + 1) % page.content.frames.length), 80);
}

function prepareSlider() {
  const slider = document.getElementById("instant"), button = document.getElementById("play");
  slider.max = `${page.content.frames.length - 1}`;
  slider.addEventListener("input", () => setInstant(Number(slider.value)));
  button.addEventListener("click", () => play(button));
  document.getElementById("player").addEventListener("submit", (event) => event.preventDefault());
  document.getElementById("player").hidden = page.content.frames.length < 2;
  setInstant(page.content.frames.length - 1);
}

async function drawAll() {
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const figure = page.figures.find((each) => each.div === entry.target);
      figure.visible = entry.isIntersecting;
      if (figure.visible) moveFigure(figure);
    }
  });
  const order = [...page.figures.filter((each) => !each.slow), ...page.figures.filter((each) => each.slow)];
  for (const figure of order) {
    await draw(figure);
    seen.observe(figure.div);
    await new Promise((resolve) => setTimeout(resolve));
  }
}

async function main() {
  const status = document.getElementById("status");
  try {
    const [library, data] = await Promise.all([unpack("library"), unpack("data")]);
    document.head.append(element("script", {}, library));
    page.content = JSON.parse(data, numbers);
    addPictures();
    prepareSlider();
    status.textContent = "";
    await drawAll();
    const redraw = () => page.figures.forEach(draw);
    darkness.addEventListener("change", redraw);
    addEventListener("beforeprint", () => { page.printing = true; redraw(); });
    addEventListener("afterprint", () => { page.printing = false; redraw(); });
    document.body.dataset.ready = "yes";
  } catch (error) {
    status.textContent = `The pictures cannot be drawn: ${error.message} The tables below are complete.`;
    throw error;
  }
}

function addPictures() {
  if (page.content.surface) addSurface(); else addMembrane();
  addDamage();
  addTwin();
  addDeflection();
  addSensors();
  addOthers();
}

main();
