// What the guided way says of its steps.

export const WORDS = {
  footage: { name: "Footage", lead: "One video, or one folder of pictures, per camera, all of the same take." },
  calibration: { name: "Calibration", lead: "Where the cameras stand and how their lenses draw, and whether that is right." },
  background: { name: "Background", lead: "What of each picture is the person, and how far the views agree on it." },
  subject: { name: "Subject", lead: "The body that is tracked, and its measures." },
  "start-pose": { name: "Start pose", lead: "How the person stands in the frame where tracking begins." },
  track: { name: "Track", lead: "The motion, frame by frame." },
  check: { name: "Check", lead: "Whether the motion fits the pictures, and what makes it better." },
  export: { name: "Export", lead: "The motion as a file that other programs open." },
  states: { done: "done", ready: "to be done", blocked: "not yet possible", stale: "to be done again", running: "under way" },
};
