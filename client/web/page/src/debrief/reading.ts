// Reads what list and plots of a recording need: its overview, and what the overview lacks.

import { fromBinary } from '@bufbuild/protobuf';
import { FrameStateSchema } from '../gen/proto/wire_pb';
import type { EventLog, Item, Recording } from '../recording';
import type { Course } from './course';

// Larger parts without an overview are not read: list and plots show what was played.
const kWholeBytes = 100e6,
  kItems = 64;

export function take(item: Item, log: EventLog, course: Course): void {
  log.addItem(item);
  if (item.topic === '/frame_state')
    course.addState(item.tick, fromBinary(FrameStateSchema, item.data));
}

// False: what is played has to be added, because the recording is too large. Throws, with one line
// for people.
export async function readAll(
  recording: Recording,
  log: EventLog,
  course: Course,
  isGone: () => boolean,
): Promise<boolean> {
  let known = -1,
    count = 0;
  for await (const overview of recording.overviews()) {
    if (isGone()) return true;
    course.addOverview(overview); // it checks it
    log.addOverview(overview);
    known = Number(overview.firstTick) + overview.bins * overview.binTicks;
  }
  const left = recording.lastTick - Math.max(known, recording.firstTick);
  if (left <= 0) return true;
  if (
    (recording.bytes * left) / Math.max(1, recording.lastTick - recording.firstTick) >
    kWholeBytes
  )
    return false;
  for await (const item of recording.survey(known)) {
    if (isGone()) return true;
    take(item, log, course);
    // The picture goes before the plot.
    if (++count % kItems === 0) await new Promise(resolve => setTimeout(resolve, 0));
  }
  return true;
}
