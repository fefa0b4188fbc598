#pragma once

// This says what somebody probably meant who wrote a word that is not known.

#include <span>
#include <string>
#include <string_view>

namespace trocar {

// Returns the known word that `word` begins, if it has two letters or more and begins no other, or
// the one that is nearest by letters that were changed, left out, added or exchanged with the next
// one: one of them in words of up to five letters, else a third of the word's letters. Empty if
// there is none, or if two are as near.
std::string nearest_word(std::string_view word, std::span<const std::string> known);

// Returns ", did you mean WORD?", or nothing.
std::string did_you_mean(std::string_view word, std::span<const std::string> known);

}  // namespace trocar
