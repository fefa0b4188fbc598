#pragma once

// Draws one picture after another: input, camera, scene and HUD of a session, in a window or in
// memory. Thread: render thread.

#include <deque>
#include <memory>

#include "client/app/client_options.h"
#include "client/app/hands.h"
#include "client/app/pane.h"
#include "client/app/remembered.h"
#include "client/render/image_texture.h"
#include "client/replay/paired_source.h"
#include "client/replica/peak_rings.h"
#include "client/ui/hud.h"
#include "common/base/background.h"

namespace trocar::app {

// A picture keeps this of a lesson: the stage's image, one's own best points, and for whom
// practises alone the wish to leave it, to repeat it or to take the next one.
struct LessonPart {
  render::ImageTexture texture;
  std::string file;  // that it was made from
  BestPoints best;
  bool offers_ways_on = false;
  std::optional<ui::AfterLesson> wish;  // nothing: one stays, or has closed the window

  void load(const replica::Replica& replica);
};

class Picture {
 public:
  static Result<std::unique_ptr<Picture>> make(const ClientOptions& options,
                                               const std::string& title);

  // Shows the second recording beside the first: `second` is what the pair's second has sent.
  // Both outlive the picture.
  void stand_beside(const ClientOptions& options, replay::PairedSource& pair,
                    const replica::Replica& second);

  // Draws the session as it is at `now_ns` and acts on what the person does.
  void draw(const replica::Replica& replica, replica::SessionSource& source, Hands& hands,
            std::uint64_t now_ns);
  // To be called often: frames pass faster than pictures are drawn.
  void observe(const replica::Replica& replica, const Hands& hands, std::uint64_t now_ns);
  bool should_close() const { return context_->should_close() || lesson_.wish; }
  LessonPart& lesson() { return lesson_; }
  // Draws this share of the pixels along a side; a picture to keep has all of them.
  void set_fineness(float share);
  bool is_software() const { return context_->is_software(); }
  std::uint64_t count() const { return count_; }
  // Draws once more what was drawn last, as finely as it goes, and returns it.
  render::Image image();
  Status save(const std::string& file);

 private:
  explicit Picture(std::unique_ptr<render::GlContext> context, const ClientOptions& options);

  void add_felt_hands(const Hands& hands, ui::HudModel& model) const;
  ui::HudModel hud_model(const replica::Replica& replica, replica::SessionSource& source,
                         Hands& hands, std::uint64_t now_ns) const;
  // Follows the view of who has it, if the person wants to, or says where one's own is.
  void share_view(const replica::Replica& replica, replica::SessionSource& source,
                  const device::PointerInput& input);
  void move_mouse_tool(const replica::Replica& replica, Hands& hands,
                       const device::PointerInput& input, float seconds);
  // Takes the click that measures out of the input.
  void take_measure(const replica::Replica& replica, device::PointerInput& input);
  void add_measure(ui::HudModel& model) const;
  void toggle_measure();
  // The parts below are about a second recording, if there is one.
  void lay_out();
  void observe_beside();
  void update_beside(std::uint64_t now_ns);
  void move_cameras(const replica::Replica& replica, const device::PointerInput& input,
                    float seconds);
  void make_beside_scene(float seconds);
  void draw_panes(render::Quality quality);
  void stand_still();
  void act_beside(const ui::HudActions& actions);
  void leave_lent_views();
  ui::HudHalf half(std::size_t number, const Pane& pane, const replica::Replica& replica) const;
  void add_halves(const replica::Replica& replica, ui::HudModel& model) const;
  void act(const ui::HudActions& actions, const replica::Replica& replica,
           replica::SessionSource& source);

  struct Rate {  // over the last second
    std::uint64_t start_ns = 0, pictures = 0, frames = 0, bytes = 0;
    double pictures_per_second = 0, frames_per_second = 0, bytes_per_second = 0;

    void measure(const replica::ReplicaCounters& counters, std::uint64_t count,
                 std::uint64_t now_ns);
  };
  replica::Role role_;
  std::unique_ptr<render::GlContext> context_;
  Pane pane_;
  struct Beside {
    replay::PairedSource& pair;
    const replica::Replica& replica;
    Pane pane;
    bool has_own_view = false;
    bool is_pointed_at = false;  // the pointer is there, or its button went down there
  };
  std::unique_ptr<Beside> beside_;  // null: there is one session
  ui::Hud hud_;
  std::uint64_t last_ns_ = 0, count_ = 0;
  std::uint64_t help_until_ns_ = 0;  // shown at first, then until asked for; 0: as the person wants
  bool shows_help_ = false, wants_screenshot_ = false;
  Overlays overlays_;
  StartView view_;
  bool is_measuring_ = false, was_left_ = false;
  // Keeps what each device has rendered and what the server said, N.
  using FeltForces = replica::PeakRings<2, ui::kFeltBins, ui::kFeltBins>;
  std::array<FeltForces, kToolsPerHand> felt_forces_;
  struct SharedView {
    bool follows = false;
    std::uint64_t sent_ns = 0;
  } shared_view_;
  Rate rate_;
  LessonPart lesson_;
  Background saving_;  // writes screenshots
};

}  // namespace trocar::app
