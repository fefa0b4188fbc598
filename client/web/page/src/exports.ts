// The module exports these (client/web/wasm/exports.cpp): numbers and places in its memory.

export interface Exports {
  memory: WebAssembly.Memory;
  _initialize(): void;
  restart(): void;
  input(bytes: number): number;
  receive(bytes: number, nowMs: number): number;
  receive_bare(field: number, bytes: number, nowMs: number): number;
  error(): number;
  outbox(): number;
  outbox_size(): number;
  outbox_clear(): void;
  frames(): number;
  mismatches(): number;
  surface_crc(): number;
  own_crc(): number;
  is_in_step(): number;
  newest_tick(): number;
  newest_frame(): number;
  newest_server_us(): number;
  shown_tick(): number;
  update(nowMs: number, triangleBudget: number, overlay: number): number;
  geometry_version(): number;
  vertices(): number;
  triangles(): number;
  outer_triangles(): number;
  triangles_at(): number;
  positions_at(): number;
  normals_at(): number;
  lips_at(): number;
  rest_at(): number;
  overlay_at(): number;
  receive_fine_surface(bytes: number): void;
  fine_is_shown(): number;
  fine_fault(): number;
  fine_geometry_version(): number;
  fine_motion_version(): number;
  fine_vertices(): number;
  fine_parted(): number;
  fine_triangles(): number;
  fine_triangles_at(): number;
  fine_positions_at(): number;
  fine_normals_at(): number;
  fine_lips_at(): number;
  fine_overlay_at(): number;
  fine_rest_at(): number;
  fine_texture_at(): number;
  fine_picture_version(): number;
  fine_picture_at(): number;
  fine_picture_bytes(): number;
  blood(): number;
  waiting_tools(): number;
  tools(): number;
  tools_at(): number;
  pointers(): number;
  pointers_at(): number;
  pointer_colour(slot: number): number;
  hand_take(
    hand: number,
    radiusM: number,
    lengthM: number,
    halfWidthM: number,
    edgeM: number,
    gripN: number,
    form: number,
  ): void;
  hand_input(): number;
  hand_switch(hand: number): void;
  hand_update(seconds: number): void;
  hand_sample(hand: number, nowMs: number): number;
  lesson_target(): number;
  drawing_at(): number;
  threads_at(): number;
  attach(x: number, y: number, z: number): number;
  make_tool(
    radiusM: number,
    lengthM: number,
    halfWidthM: number,
    edgeM: number,
    form: number,
    colour: number,
  ): number;
  jaw(): number;
  hinge(): number;
  jaw_opening(form: number, verb: number, hasClaim: boolean): number;
  jaw_seconds(form: number, verb: number, hasClaim: boolean): number;
  lens(slot: number, radiusM: number, form: number): number;
  clear_eye(x: number, y: number, z: number, yaw: number, pitch: number, isLens: boolean): number;
  look(isInside: boolean): number;
  make_arrow(lengthM: number, radiusM: number, colour: number): number;
  make_hand_line(lengthM: number, colour: number): number;
  mesh_vertices(): number;
  slot_colour(slot: number): number;
  noise(size: number): number;
  lobules(size: number): number;
}
