#pragma once

// Answers whether recordings verify, by "trocar-journal verify" in processes of their own. Only
// what somebody asks for is checked: one recording at a time, the others wait in order. What came
// out is kept in the state folder, checks/NAME.json, for as long as size and time of last change of
// the recording and sim_version stay what they were. A check that came to no end can be asked for
// again.
//
// Bounds: 16 recordings wait; a check that takes longer than its limit is ended; a recording that
// has changed within 5 s is still being written and is not checked. Thread: that of the I/O
// context.
//
// Answers are a JSON object: "state" is not asked, waiting, running, growing, failed (it came
// to no end), verified, different or unknown; "text" is one line for people; "tick" is that of the
// first difference, else null.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/app/web/check_process.h"
#include "server/web/site/recordings.h"

namespace trocar::app {

class RecordingChecks {
 public:
  static constexpr std::size_t kMostWaiting = 16;

  RecordingChecks(asio::io_context& context, std::filesystem::path state_folder,
                  std::chrono::seconds limit);

  // Says what is known of a recording.
  std::string known(const std::string& name, const site::OpenRecording& recording) const;
  // The same; a recording that has not been checked is from now on.
  std::string ask(const std::string& name, std::unique_ptr<site::OpenRecording> recording);
  // Ends a check that runs, and forgets those that wait.
  void stop();

 private:
  struct Task {
    std::string name;
    std::unique_ptr<site::OpenRecording> recording;
  };
  std::optional<std::string> kept(const std::string& name,
                                  const site::OpenRecording& recording) const;
  void begin_next();
  void look();
  void fail(const Task& task, const std::string& why);
  void keep(const Task& task, const std::string& state, const std::string& text,
            std::optional<std::uint64_t> tick);
  void keep(const Task& task, const CheckProcess::Outcome& outcome);
  std::filesystem::path file_of(const std::string& name) const;

  const std::filesystem::path program_, folder_;
  const std::chrono::seconds limit_;
  asio::steady_timer timer_;
  std::deque<Task> tasks_;                     // the first one runs
  std::map<std::string, std::string> failed_;  // answers for checks that came to no end
  std::optional<CheckProcess> process_;
  std::chrono::steady_clock::time_point begun_;
};

}  // namespace trocar::app
