// Numbers of Envelope's fields: they tell messages apart that are not parsed.

import { EnvelopeSchema, type Envelope } from './gen/proto/wire_pb';

export type MessageName = NonNullable<Envelope['message']['case']>;

export const numberOf = (name: MessageName): number => EnvelopeSchema.field[name]!.number;

// The number of the field with which an Envelope begins.
export function firstNumber(bytes: Uint8Array): number {
  const first = bytes[0] ?? 0;
  return first < 0x80 ? first >> 3 : ((first & 0x7f) | ((bytes[1] ?? 0) << 7)) >> 3;
}
