#pragma once

// People show one another a point, lines on the surface, and a view to follow.

#include "server/session/replication/audience.h"
#include "server/session/replication/drawing_board.h"

namespace trocar::proto {
class Drawing;
class PointRequest;
class StrokeRequest;
class ViewRequest;
}  // namespace trocar::proto

namespace trocar::replication {

class Drawing {
 public:
  explicit Drawing(SessionContext& session) : session_(session) {}

  std::optional<Ending> point(Speaker& who, const proto::PointRequest& request);
  // `layout` is that of the newest frame.
  std::optional<Ending> stroke(Speaker& who, const proto::StrokeRequest& request,
                               const wire::SurfaceLayout& layout);
  std::optional<Ending> view(Speaker& who, const proto::ViewRequest& request);

  void wipe();
  // Another one leads the view, or nobody.
  void forget_view() { last_view_.reset(); }
  // Gives a newcomer what is drawn, and the view to follow; false: there is no room for it.
  bool show_lines(const Speaker& newcomer) const;
  bool show_view(const Speaker& newcomer) const;

 private:
  void describe(proto::Drawing& message) const;
  void record() const;

  SessionContext& session_;
  DrawingBoard board_;
  wire::SharedBytes last_view_;  // null: none since the view was given to somebody
};

}  // namespace trocar::replication
