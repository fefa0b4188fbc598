#pragma once

// A server as a process in a session of its own (setsid): it goes on when its hall ends, and a
// later hall finds it again. A process is known by its id and the time of its start, and by its
// command line, so that an id that the system has given to another program is never taken for it.
//
// Thread: that which started it.

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/process/process.h"

namespace trocar::hall {

struct ProcessId {
  pid_t pid = 0;
  std::uint64_t started_at = 0;  // clock ticks after the machine's start, proc(5)
};

class ServerProcess {
 public:
  using Ending = process::Ending;

  // Runs `program` with `arguments` as they are, without a shell. Standard output and errors go to
  // the end of `log`, of mode 0600; no other file of this program is open in it. Error: it cannot
  // be started.
  static Result<ServerProcess> start(const std::filesystem::path& program,
                                     const std::vector<std::string>& arguments,
                                     const std::filesystem::path& log);
  // The process that another hall had started with `arguments`; nothing if it has ended.
  static std::optional<ServerProcess> find(const ProcessId& id,
                                           const std::vector<std::string>& arguments);

  ServerProcess(ServerProcess&& other) noexcept;
  ServerProcess& operator=(ServerProcess&& other) noexcept;
  ~ServerProcess();  // leaves it running

  const ProcessId& id() const { return id_; }
  // Nothing while it runs; does not wait. Of one that another hall had started nobody knows how it
  // has ended.
  std::optional<Ending> poll();
  // It never reaches another process of that id.
  void signal(int number) const;
  // Processor seconds so far, of all its threads; nothing once it has ended.
  std::optional<double> processor_seconds() const;

 private:
  ServerProcess(ProcessId id, int descriptor) : id_(id), descriptor_(descriptor) {}

  ProcessId id_;
  int descriptor_ = -1;                  // of the process, pidfd_open(2)
  std::optional<process::Child> child_;  // nothing: another hall had started it
};

}  // namespace trocar::hall
