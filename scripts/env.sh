# shellcheck shell=bash
# Source this in bash or zsh: it gives the shell the project's environment, and makes it first if need be.
#
#     source scripts/env.sh
#
# It changes variables only. When something is wrong it says so, returns non-zero, and leaves the shell as it was.

if [ -n "${BASH_VERSION-}" ]; then
    _fbql_file=${BASH_SOURCE[0]}
elif [ -n "${ZSH_VERSION-}" ]; then
    eval '_fbql_file=${(%):-%x}'
else
    _fbql_file=
    echo "fbql: scripts/env.sh is for bash and zsh" >&2
fi

if [ -z "$_fbql_file" ]; then
    false
elif [ -n "${BASH_VERSION-}" ] && [ "$_fbql_file" = "$0" ]; then
    echo "fbql: this changes the variables of the shell that sources it: source $0" >&2
    false
elif _fbql_commands=$(command python3 "$(dirname -- "$_fbql_file")/environment"); then
    eval "$_fbql_commands"
else
    false
fi

_fbql_status=$?
unset _fbql_file _fbql_commands
eval "unset _fbql_status; return $_fbql_status 2>/dev/null || exit $_fbql_status"
