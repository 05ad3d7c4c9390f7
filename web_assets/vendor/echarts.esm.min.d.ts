// What the pages use of ECharts; an option is checked by ECharts itself.

export interface Chart {
  setOption(option: object, how?: { notMerge?: boolean }): void;
  getOption(): any;
  on(event: string, act: (event: any) => void): void;
  getZr(): { on(event: string, act: (event: any) => void): void };
  convertFromPixel(finder: object, pixel: [number, number]): number[];
  dispatchAction(action: object): void;
  resize(size?: { width: number | "auto" }): void;
  getWidth(): number;
  getHeight(): number;
  renderToSVGString(): string;
  isDisposed(): boolean;
  dispose(): void;
}
export function init(element: HTMLElement | null, theme: null, options: { renderer: "canvas" | "svg"; ssr?: boolean; width?: number; height?: number }): Chart;
