#pragma once

// Comments are sentences: they have a subject and a verb, and are short enough to be read once.

#include <string>
#include <vector>

#include "tests/architecture/source_tree.h"

namespace trocar::architecture {

// A comment on lines of its own that is no sentence.
struct Fragment {
  std::string path;
  int line = 0;  // from 1
  std::string text;
};

// A comment is a fragment if its first word is one with which fragments begin (Of, What, Where,
// ...), or if it has four words or more and none can be a finite verb. Second paragraphs, trailing
// comments and formulas are not looked at. The rule is precise rather than complete: a noun with a
// plural s passes for a verb.
std::vector<Fragment> find_fragments(const SourceFile& file);

}  // namespace trocar::architecture
