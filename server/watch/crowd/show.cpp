#include "server/watch/crowd/show.h"

#include "proto/wire.pb.h"

namespace trocar::crowd {

using follow::News;

Show::Show(net::Connections& connections, replication::ReplicatorOptions limits,
           replication::ReplicatorCounters& counters, SayUp say_up)
    : limits_(std::move(limits)),
      counters_(counters),
      say_up_(std::move(say_up)),
      copy_(std::make_unique<follow::SessionCopy>()),
      viewers_(connections, *this, limits_, counters) {}

bool Show::has_picture() const {
  return viewers_.newest() && copy_->has_frame() &&
         viewers_.newest()->epoch == copy_->newest()->epoch;
}

void Show::begin_anew() {
  // Who has a part of the fine surface alone gets it anew, whole.
  viewers_.begin_fine_parts(copy_->has_all_fine_parts() ? copy_->fine_parts().size() : SIZE_MAX);
  copy_ = std::make_unique<follow::SessionCopy>();
  is_new_ = true;
}

Status Show::take(const proto::Envelope& message, const wire::SharedBytes& framed) {
  const auto news = copy_->take(message, framed);
  if (!news) return news.error();
  if (copy_->needs_keyframe()) {
    proto::Envelope request;
    request.mutable_keyframe_request();
    say_up_(request);
  }
  switch (*news) {
    case News::Nothing:
    case News::FinePart:  // give_all() gives it
      break;
    case News::Frame:
      acknowledge();
      break;
    case News::WholeFrame:
      publish(framed);
      break;
    case News::NewSurface:
      viewers_.replace_surface(framed, viewers_.newest() ? viewers_.newest()->frame + 1 : 0);
      break;
    case News::Event:
      if (message.has_surface_change())
        viewers_.change_surface(message.surface_change().epoch(), framed);
      else
        viewers_.broadcast(framed);
      break;
    case News::Fleeting:
      viewers_.offer(framed, but(message));
      break;
    case News::LastFrame:
      acknowledge();
      if (!copy_->has_frame()) break;
      if (!has_picture() || viewers_.newest() != copy_->newest()) publish(copy_->state());
      viewers_.give_last(framed);
      break;
  }
  return {};
}

void Show::acknowledge() {
  if (!copy_->has_frame()) return;
  proto::Envelope envelope;
  copy_->acknowledge(*envelope.mutable_frame_ack());
  say_up_(envelope);
}

void Show::publish(const wire::SharedBytes& state) {
  const auto& before = viewers_.newest();
  const bool is_earlier = before && copy_->newest()->frame < before->frame;
  if (std::exchange(is_new_, false) && is_earlier) restart();
  viewers_.set_frame(copy_->newest(), copy_->server_time_us(), state);
  ++counters_.frames_published;
  give_all();
}

void Show::give_all() {
  if (has_picture()) viewers_.give_all();
}

bool Show::show(const replication::Viewer& who) {
  for (const auto& message : copy_->all_but_frames())
    if (!viewers_.send(who.id, message)) return false;
  return true;
}

}  // namespace trocar::crowd
