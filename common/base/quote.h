#pragma once

#include <string>
#include <string_view>

namespace trocar {

// A text as a string of JSON or TOML (a basic one), quotation marks included, whatever UTF-8 it
// holds.
std::string quote(std::string_view text);

// A text as it stands in HTML, in an attribute, too: no character of it is read as markup.
std::string html_escaped(std::string_view text);

}  // namespace trocar
