#pragma once

// Programs and folders that people use in a session see no paper's own method and no off-line tool.

#include "tests/architecture/rules.h"

namespace trocar::architecture {

// The product is common, organs, tissue, session, client and the server's and journal's programs.
// None of its folders includes server/papers or server/lab, or sees them through DEPENDS.
Breaches check_product_sees_no_paper(const SourceTree& tree);

}  // namespace trocar::architecture
