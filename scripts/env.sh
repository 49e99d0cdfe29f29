# shellcheck shell=bash
# Source this in bash or zsh: it gives the shell the project's environment, and makes it first if need be.
#
#     source scripts/env.sh
#
# It changes variables only. When something is wrong it says so, returns non-zero, and leaves the shell as it was.

# $1: this file, empty in a shell that does not tell. $2: sourced, or anything else when it was run as a program.
_fbql_environment() {
    local commands
    if [ -z "$1" ]; then
        echo "fbql: scripts/env.sh is for bash and zsh" >&2
    elif [ "$2" != sourced ]; then
        echo "fbql: this changes the variables of the shell that sources it: source $1" >&2
    elif ! command -v python3 > /dev/null; then
        echo "fbql: there is no python3 on PATH; install Python 3.12 and source this again" >&2
    elif commands=$(command python3 "$(dirname -- "$1")/environment"); then
        eval "$commands"
        return 0
    fi
    return 1
}

if [ -n "${BASH_VERSION-}" ]; then
    if [ "${BASH_SOURCE[0]}" != "$0" ]; then
        _fbql_environment "${BASH_SOURCE[0]}" sourced
    else
        _fbql_environment "$0" run
    fi
elif [ -n "${ZSH_VERSION-}" ]; then
    eval '_fbql_environment "${(%):-%x}" "${${ZSH_EVAL_CONTEXT##*file*}:-sourced}"'
else
    _fbql_environment "" ""
fi
eval "unset -f _fbql_environment; return $? 2> /dev/null || exit 1"
