#pragma once

// A tool's shape on the wire and in journals: what is absent is as tools are by default. Ranges
// are checked by tool::is_valid, not here.

#include "common/tool/tool.h"
#include "proto/wire.pb.h"

namespace trocar::wire {

inline void write(const tool::ToolShape& shape, proto::ToolShape& message) {
  message.set_radius_m(shape.radius_m);
  message.set_length_m(shape.length_m);
  message.set_reach_m(shape.reach_m);
  message.set_half_width_m(shape.half_width_m);
  message.set_friction(shape.friction);
  message.set_grip_n(shape.grip_n);
  message.set_edge_m(shape.edge_m);
  message.set_form(static_cast<proto::ToolForm>(shape.form));
}

inline tool::ToolShape read(const proto::ToolShape& message) {
  tool::ToolShape shape{message.radius_m(), message.length_m(), message.reach_m()};
  if (message.has_half_width_m()) shape.half_width_m = message.half_width_m();
  if (message.has_friction()) shape.friction = message.friction();
  if (message.has_grip_n()) shape.grip_n = message.grip_n();
  if (message.has_edge_m()) shape.edge_m = message.edge_m();
  // A form that is not known here is none that is_valid() knows.
  const int form = message.form();
  shape.form =
      static_cast<tool::Form>(form >= 0 && form < tool::kFormCount ? form : tool::kFormCount);
  return shape;
}

}  // namespace trocar::wire
