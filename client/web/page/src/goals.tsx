// The panel of a lesson: its stage, what to do, how far that is, and in the end what was measured.

import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { LessonGoal, type LessonProgress, type LessonStage } from './gen/proto/wire_pb';

export interface Goal {
  stage: LessonStage;
  progress: LessonProgress | null; // null: a recording does not say
  seconds: number; // since the stage began
}

const minutes = (seconds: number): string =>
  `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, '0')}`;

function Progress(props: { goal: Goal }): JSX.Element {
  const { stage, progress } = props.goal,
    seconds = Math.min(props.goal.seconds, stage.limitS),
    percent = Math.floor((progress?.progress ?? 0) * 100);
  // An answer reaches what is to be found at once, or not.
  const hasProgress = progress !== null && stage.goal !== LessonGoal.FIND;
  return (
    <>
      {hasProgress && (
        <p class="far">
          <progress max={100} value={percent} aria-label="How far the goal is" />
          <span aria-hidden="true">{`${percent} %`}</span>
        </p>
      )}
      <dl>
        <dt>Time left</dt>
        <dd>{`${minutes(Math.max(0, stage.limitS - seconds))} of ${minutes(stage.limitS)}`}</dd>
        {stage.forceLimitN > 0 && <dt>Force</dt>}
        {stage.forceLimitN > 0 && (
          <dd class={progress?.isTooStrong ? 'strong' : ''}>
            {progress?.isTooStrong
              ? `more than ${stage.forceLimitN.toFixed(1)} N: be gentler`
              : `at most ${stage.forceLimitN.toFixed(1)} N`}
          </dd>
        )}
      </dl>
    </>
  );
}

function StagePicture(props: { bytes: Uint8Array }): JSX.Element {
  const { bytes } = props,
    [address, setAddress] = useState('');
  useEffect(() => {
    const made = URL.createObjectURL(
      new Blob([bytes.slice()], { type: bytes[0] === 0x89 ? 'image/png' : 'image/jpeg' }),
    );
    setAddress(made);
    return () => URL.revokeObjectURL(made);
  }, [bytes]);
  return <img class="shown" src={address} alt="What to do, as a picture" />;
}

function Results(props: { stage: LessonStage }): JSX.Element | null {
  const { stage } = props;
  if (stage.result.length === 0) return null;
  return (
    <ul class="results" aria-label="Results">
      {stage.result.map((result, i) => (
        <li key={i}>
          <details open={stage.isOver}>
            <summary>
              <b>{result.name}</b>
              {result.isReached ? ': reached, ' : ': not reached, '}
              {`${result.points.toFixed(0)} points`}
            </summary>
            <ul>
              {result.line.map((line, k) => (
                <li key={k}>{line}</li>
              ))}
            </ul>
          </details>
        </li>
      ))}
    </ul>
  );
}

// `lead`: what an instructor may do; `answer`: says that the place is found; nothing for others.
export function LessonPanel(props: {
  goal: Goal;
  lead?: { next(): void; restart(): void };
  answer?: () => void;
}): JSX.Element {
  const { stage } = props.goal,
    { lead } = props;
  return (
    <section class="goal" aria-labelledby="goal">
      <h2 id="goal">{stage.title}</h2>
      <div role="status">
        {stage.isOver ? (
          <p class="over">{`The lesson is over: ${stage.points.toFixed(0)} of 100 points`}</p>
        ) : (
          <>
            <p class="now">
              <small>{`Stage ${stage.stage + 1} of ${stage.stages}`}</small> <b>{stage.name}</b>
            </p>
            <p>{stage.text}</p>
            {stage.picture.length > 0 && <StagePicture bytes={stage.picture} />}
            {stage.hint !== '' && <p class="hint">{`Hint: ${stage.hint}`}</p>}
          </>
        )}
      </div>
      {!stage.isOver && <Progress goal={props.goal} />}
      {props.answer && !stage.isOver && stage.goal === LessonGoal.FIND && (
        <button class="main" onClick={props.answer} title="Touch the place first">
          It is here
        </button>
      )}
      <Results stage={stage} />
      {lead && (
        <div class="row">
          {!stage.isOver && <button onClick={lead.next}>Next stage</button>}
          <button onClick={lead.restart}>Restart lesson</button>
        </div>
      )}
    </section>
  );
}
