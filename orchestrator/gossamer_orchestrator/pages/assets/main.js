// Show the words, unpack, draw what the window shows, then the rest one by one while nothing else is to do.
const shown = () => new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
const idle = () => new Promise((resolve) => (window.requestIdleCallback || setTimeout)(resolve));

function inWindow({ div }) {
  const { top, bottom } = div.getBoundingClientRect();
  return top < window.innerHeight && bottom > 0;
}

// The body says how far it is: "window", all in the window is drawn and works; "all", so is the rest.
function reached(what) {
  document.body.dataset.ready = what;
  performance.mark(what);
}

async function drawAll() {
  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const figure = page.figures.find((each) => each.div === entry.target);
      figure.visible = entry.isIntersecting;
      if (figure.visible) drawOnce(figure).then(() => moveFigure(figure));
    }
  }, { rootMargin: "200px" });
  const order = [...page.figures.filter((each) => !each.slow), ...page.figures.filter((each) => each.slow)];
  for (const figure of order.filter(inWindow)) {
    await drawOnce(figure);
    await shown();
  }
  reached("window");
  page.figures.forEach((figure) => near.observe(figure.div));
  for (const figure of order) {
    await idle();
    await drawOnce(figure);
  }
  reached("all");
}

// Draws all pictures in light colours and as wide as paper before the paper is laid out. A view in 3-D is drawn at once only if it is new.
function preparePaper(begins) {
  page.printing = begins;
  document.body.classList.toggle("paper", begins);
  for (const figure of page.figures) {
    figure.camera = figure.div.layout?.scene?.camera;
    if (figure.camera) Plotly.purge(figure.div);
    draw(figure);
  }
}

async function main() {
  const status = document.getElementById("status");
  try {
    await shown();
    const [library, data] = await Promise.all([unpack("library"), unpack("data")]);
    document.head.append(element("script", {}, library));
    page.content = JSON.parse(data, numbers);
    addPictures();
    fillRows();
    status.textContent = "";
    darkness.addEventListener("change", () => drawAnew(page.figures));
    addEventListener("beforeprint", () => preparePaper(true));
    addEventListener("afterprint", () => preparePaper(false));
    await drawAll();
  } catch (error) {
    const why = error.message.replace(/[.\s]*$/, "");
    status.textContent = `The pictures cannot be drawn: ${why}. The tables below are complete.`;
    throw error;
  }
}

main();
