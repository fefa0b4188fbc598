#pragma once

// Pieces of the report's page.

#include <string>
#include <string_view>

namespace trocar::assessment {

// The text as it stands in a page: no character of it is read as markup.
std::string html_text(std::string_view text);
// An image in the page itself; `type`: "image/svg+xml". `words`: for who does not see it.
std::string html_image(std::string_view type, std::string_view bytes, const std::string& words);
// A whole page; `body` is markup.
std::string html_page(const std::string& title, const std::string& body);

}  // namespace trocar::assessment
