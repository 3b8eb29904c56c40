#include "Interrupt.h"

#include <csignal>
#include <iostream>

#include "Result.h"

namespace jacket::demo {

namespace {

volatile std::sig_atomic_t interrupted = 0;

void onSignal(int) {
    interrupted = 1;
    for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
}

}  // namespace

void catchInterrupts() {
    if (isInterrupted()) return;
    for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, onSignal);
}

bool isInterrupted() {
    return interrupted != 0;
}

int endInterrupted(bool hasFolder) {
    std::cerr << "jacket: interrupted" << (hasFolder ? "; nothing was written" : "") << '\n';
    return kInterrupted;
}

}  // namespace jacket::demo
