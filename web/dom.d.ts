// What tsc cannot know of the pages: what a selector finds, and where an event happened, is what the template has there.
interface ParentNode {
  querySelector(selectors: string): any;
  querySelectorAll(selectors: string): NodeListOf<any>;
}
interface Element {
  closest(selectors: string): any;
}
interface Document {
  getElementById(id: string): any;
}
interface EventTarget {
  closest?: any;
  dataset?: any;
  matches?: any;
  setCustomValidity?: any;
}
interface Event {
  detail?: any;
}
// Web Bluetooth, which no browser but Chromium's has
interface Navigator {
  bluetooth?: any;
}
