#include "server/app/server/check_start.h"

#include <filesystem>
#include <string>

#include "common/base/kept_file.h"
#include "common/base/writable.h"
#include "common/intake/acceptor.h"
#include "common/journal/session_journal.h"
#include "server/app/server/admission.h"
#include "server/app/server/browser_page.h"
#include "server/app/server/session_start.h"
#include "server/organs/catalogue/load_organ.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

// A recording never replaces another one; a device may take it.
Status check_journal(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_regular_file(path, ignored))
    return Error{ErrorCode::BadFile, path.string() + " exists already, name another file"};
  return check_writable(path);
}

Status check_organ(const ServerOptions& options,
                   const std::function<Status(const char*, Status)>& of) {
  auto organ = catalogue::load_organ(options.organ);
  if (!organ) return of("organ", organ.error());
  if (const auto chosen = choose_strain(options, *organ); !chosen)
    return of("averaged-strain", chosen);
  return {};
}

}  // namespace

Status check_end(const ServerOptions& options) {
  for (const auto& [key, file] :
       {std::pair{"--summary", &options.summary_file}, {"--ready-file", &options.ready_file}})
    if (!file->empty()) {
      if (fs::path(*file).lexically_normal() == fs::path(options.journal).lexically_normal())
        return Error{ErrorCode::Usage,
                     std::string(key) + ": " + *file + " is --journal, too: choose another name"};
      if (auto fine = check_output(key, *file); !fine) return fine;
    }
  return {};
}

Status check_start(const ServerOptions& options) {
  // Puts the option's place before an error that does not have it yet.
  const auto of = [&options](const char* key, const Status& status) -> Status {
    if (status) return status;
    const auto& [code, message] = status.error();
    const auto placed = options.origins.placed(message);
    if (message.starts_with("--")) return Error{code, placed};
    return Error{code, options.origins.place_of(key) + ": " + message};
  };
  const auto& access = options.access;
  if (!access.revoke.empty())
    return of("revoke", Error{ErrorCode::Usage, "starts no session that could be checked"});
  if (!access.new_code.empty())
    return of("new-code", Error{ErrorCode::Usage, "starts no session that could be checked"});
  if (const auto s = intake::check_address(options.address, "--listen"); !s) return of("listen", s);
  if (!options.metrics_address.empty())
    if (const auto s = intake::check_address(options.metrics_address, "--metrics"); !s)
      return of("metrics", s);
  if (options.has_page)
    if (const auto s = BrowserPage::check(options); !s) return of("browser", s);
  const char* identity = access.certificate_file.empty() ? "state" : "certificate";
  if (const auto s = Admission::check(access, options.address); !s) return of(identity, s);
  if (!options.resume_file.empty())
    if (const auto s = journal::SessionJournal::open(options.resume_file); !s)
      return of("resume", s.error());
  if (const auto s = check_organ(options, of); !s) return s;
  if (options.journal != "none")
    if (const auto s = check_journal(options.journal); !s) return of("journal", s);
  if (const auto s = read_signing_key(options); !s) return of("sign", s.error());
  if (!access.audit_file.empty())
    if (const auto s = check_writable(access.audit_file); !s) return of("audit", s);
  return of("summary", check_end(options));
}

}  // namespace trocar::app
