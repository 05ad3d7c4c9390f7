// Put first into viser's own page: without a graphics card a smoothed picture takes the processor
// about twice as long.

if (window.parent.document.documentElement.dataset.drawing === "software") {
  const prototype = HTMLCanvasElement.prototype;
  const getContext = /** @type {any} */ (prototype.getContext);
  /** @param {string} kind @param {any} [options] */
  prototype.getContext = function (kind, options) {
    return getContext.call(
      this,
      kind,
      kind.startsWith("webgl") ? { ...options, antialias: false } : options,
    );
  };
}
