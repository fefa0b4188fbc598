// What a person takes along: the picture, a clip, tables of forces and events, a report.

import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import type { Still } from './export';
import { save } from './save';

const kMostClipMs = 600_000,
  kClipRate = 30; // pictures a second
const kClipKinds = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm'];
const kNoClip = 'This browser cannot record clips: it has no WebM.';

interface Props {
  name: string; // the recording's
  isWhole: boolean; // the tables hold all of it
  still: Still;
  forces(): string; // tables
  events(): string;
  onReport(): Promise<void>;
}

const clipKind = (): string | undefined =>
  typeof MediaRecorder === 'undefined'
    ? undefined
    : kClipKinds.find(kind => MediaRecorder.isTypeSupported(kind));

export function Take(props: Props): JSX.Element {
  const [fault, setFault] = useState(''),
    [isRecording, setIsRecording] = useState(false),
    [isMaking, setIsMaking] = useState(false),
    recorder = useRef<MediaRecorder | null>(null);
  const base = props.name.replace(/\.mcap$/, '');
  const table = (text: string): Blob => new Blob(['\ufeff', text], { type: 'text/csv' });
  const report = async (): Promise<void> => {
    setIsMaking(true);
    await props.onReport();
    setIsMaking(false);
  };
  const takePicture = async (): Promise<void> => {
    await props.still.next();
    props.still.canvas.toBlob(
      blob => (blob ? save(`${base}.png`, blob) : setFault('This browser makes no PNG.')),
      'image/png',
    );
  };
  const stop = (): void => {
    if (recorder.current?.state === 'recording') recorder.current.stop();
  };
  const begin = async (): Promise<void> => {
    const kind = clipKind(),
      parts: Blob[] = [];
    if (!kind) return setFault(kNoClip);
    props.still.isWanted = true;
    await props.still.next();
    try {
      const made = new MediaRecorder(props.still.canvas.captureStream(kClipRate), {
        mimeType: kind,
      });
      recorder.current = made;
      made.ondataavailable = event => parts.push(event.data);
      made.onerror = () => setFault('The clip has ended: the browser cannot record it.');
      made.onstop = () => {
        recorder.current = null;
        made.stream.getTracks().forEach(track => track.stop());
        props.still.isWanted = false;
        setIsRecording(false);
        if (parts.some(part => part.size > 0))
          save(`${base}.webm`, new Blob(parts, { type: 'video/webm' }));
      };
      made.start(1000);
      window.setTimeout(() => {
        if (recorder.current === made) stop();
      }, kMostClipMs);
      setFault('');
      setIsRecording(true);
    } catch {
      props.still.isWanted = false;
      setFault(kNoClip);
    }
  };
  useEffect(() => stop, []);
  return (
    <section aria-labelledby="take" class="take">
      <h2 id="take">Export</h2>
      <div class="row">
        <button onClick={() => void takePicture()}>Picture</button>
        <button aria-pressed={isRecording} onClick={() => (isRecording ? stop() : void begin())}>
          {isRecording ? 'End the clip' : 'Clip'}
        </button>
        <button onClick={() => save(`${base}.forces.csv`, table(props.forces()))}>
          Forces as a table
        </button>
        <button onClick={() => save(`${base}.events.csv`, table(props.events()))}>
          Events as a table
        </button>
        <button disabled={isMaking} onClick={() => void report()}>
          Report for paper
        </button>
      </div>
      {fault && (
        <p class="fault" role="alert">
          {fault}
        </p>
      )}
      {!props.isWhole && <p class="none">The tables hold what has been read so far.</p>}
    </section>
  );
}
