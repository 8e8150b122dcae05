// The play button, the slider and what they say of the time.

const SHORTEST_SHOW = 1.5;  // seconds of watching; quicker motions are slowed down,
const MOST_SLOWED = 4;      // at most so many times

/** Plays the stage's chosen motion. The returned `rewind` is for after another one was chosen. */
export function makePlayer(root, stage) {
  const button = root.querySelector('.play'), slider = root.querySelector('input[type=range]');
  const clock = root.querySelector('.clock'), moved = root.querySelector('.moved');
  let frame = 0;

  const slowness = () => Math.min(Math.max(Math.ceil(SHORTEST_SHOW / Math.max(stage.duration, 1e-3)), 1), MOST_SLOWED);
  const inWords = ({ shift, turn }) => `${(1000 * shift).toFixed(2)} mm and ${(turn * 180 / Math.PI).toFixed(2)}°`;

  function show(seconds) {
    stage.setTime(seconds);
    slider.value = stage.duration > 0 ? 1000 * seconds / stage.duration : 0;
    clock.textContent = `${seconds.toFixed(2)} of ${stage.duration.toFixed(2)} s`;
    slider.setAttribute('aria-valuetext', clock.textContent);
    moved.textContent = `So far things have moved by at most ${inWords(stage.moved())}.`;
  }

  function stop() {
    cancelAnimationFrame(frame);
    frame = 0;
    button.textContent = 'Play';
  }

  function play() {
    const from = Number(slider.value) >= 1000 ? 0 : Number(slider.value) / 1000 * stage.duration;
    let begin;
    const step = (now) => {
      begin ??= now;
      const seconds = Math.min(from + (now - begin) / 1000 / slowness(), stage.duration);
      show(seconds);
      if (seconds < stage.duration) frame = requestAnimationFrame(step);
      else stop();
    };
    button.textContent = 'Pause';
    frame = requestAnimationFrame(step);
  }

  button.addEventListener('click', () => (frame ? stop() : play()));
  slider.addEventListener('input', () => {
    stop();
    show(Number(slider.value) / 1000 * stage.duration);
  });
  return {
    rewind() {
      stop();
      const still = stage.duration === 0;
      button.disabled = slider.disabled = still;
      show(stage.duration);
      const total = inWords(stage.moved());
      show(0);
      moved.textContent = still ? 'As proposed; no motion of this candidate was recorded.'
        : `As proposed. While it settles, things move by at most ${total}${slowness() > 1 ? `; played ${slowness()}× slower` : ''}.`;
    },
  };
}
