#!/bin/sh
# The program PETZVAL_PROGRAM, with each option of PETZVAL_SHORT that its verb has in place of its own; `tiny` is PETZVAL_TINY where --set is an option.
set -f
has() { "$PETZVAL_PROGRAM" "$@" --help 2>/dev/null; }
add=""
for word in $PETZVAL_SHORT; do
    case "$word" in
        tiny) if has "$@" | grep -q -e "--set "; then add="$add $PETZVAL_TINY"; fi; known=no ;;
        --*) known=no; if has "$@" | grep -q -e "$word\b"; then known=yes; add="$add $word"; fi ;;
        *) if [ "$known" = yes ]; then add="$add $word"; fi ;;
    esac
done
# Options that are given twice: those of the block give way.
count=$#
while [ "$count" -gt 0 ]; do
    word=$1; shift; count=$((count - 1))
    case " $add " in
        *" $word "*) case "$word" in --set|--*=*) set -- "$@" "$word" ;; --*) if [ "$count" -gt 0 ]; then shift; count=$((count - 1)); fi ;; *) set -- "$@" "$word" ;; esac ;;
        *) set -- "$@" "$word" ;;
    esac
done
exec "$PETZVAL_PROGRAM" "$@" $add
